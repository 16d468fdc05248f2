import pytest


@pytest.fixture
def call(twillight):
    """Run the command line; return the exit code, the output in one line, and the complaint."""

    def call(*tokens):
        code, said, told = twillight(*tokens)
        return code, " ".join(said.split()), told

    return call
