import math

from reports.tables.number_format import beyond_noise, fixed, percent, plain, scientific, signed, size, span, times
from reports.tables.number_format import significant as digits


def test_numbers_are_worded():
    worded = [
        (scientific(2.62e-3), "2.62e−3"), (scientific(None), "–"), (scientific(math.nan), "–"),
        (span(scientific, 8.76e-2, 0.158), "[0.88 … 1.58]e−1"), (span(scientific, -2e-3, 1e-4), "[−2.00 … 0.10]e−3"),
        (span(scientific, 0.0, 0.0), "[0.00 … 0.00]e0"), (beyond_noise(-1e-9, scientific), "in the noise"),
        (beyond_noise(0.02, percent), "2.0 %"), (beyond_noise(math.nan, percent), "–"), (signed(1.0), "+1.00e0"),
        (signed(-0.02), "−2.00e−2"), (times(4.12), "4.1×"), (times(0.0834), "0.083×"), (times(1234.0), "1,234×"),
        (percent(0.0151, 2), "1.51 %"), (fixed(0.1234), ".123"), (fixed(1.5), "1.500"), (size(512), "512 B"),
        (size(346_896), "346.9 kB"), (size(16_300_000), "16.30 MB"), (plain("twill_4_4"), "twill 4/4"),
        (plain("wool_gabardine"), "wool gabardine"), (plain("satin_8"), "satin 8"), (digits(1696.4), "1,696"),
        (digits(12.34), "12.3"), (digits(0.0456), ".0456"), (digits(999.6), "1,000"), (digits(0.0), "0"),
        (digits(-2.0), "-2.00"),
    ]  # fmt: skip
    assert [text for text, _ in worded] == [expected for _, expected in worded]
