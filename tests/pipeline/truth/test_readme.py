import re
from pathlib import Path

import numpy as np

README = Path(__file__).parents[3] / "pipeline" / "truth" / "README.md"


def test_the_example_answers_with_the_error_it_asks_for(capsys):
    (example,) = re.findall(r"^```python\n(.*?)^```$", README.read_text(encoding="utf-8"), re.M | re.S)
    found = {}
    exec(example, found)
    answers = found["answers"]
    assert answers.mean.shape == (1, 4) and (answers.mean > 0).all()
    assert np.linalg.norm(answers.standard_error) <= 0.02 * np.linalg.norm(answers.mean)
    assert str(answers.mean) in capsys.readouterr().out
