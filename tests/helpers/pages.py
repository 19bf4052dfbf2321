"""Pages of the docs: their blocks of Python, and what they show as printed."""

import re

BLOCK = re.compile(r"```python\n(.*?)```", re.DOTALL)
NUMBER = re.compile(r"\d+\.?\d*(?:e[-+]\d+)?")
ROUNDED = 0.01  # relative: other processors round differently


def shown_below(page, block):
    """Lines that a page shows as printed by a block of code."""
    shown = re.match(r"```\n\n((?: {4}.*\n)+)", page.partition(block)[2])
    return [line.strip() for line in shown[1].splitlines()] if shown else []


def assert_printed(shown, printed):
    """Same words; numbers within 1 %, or one of the last digit."""
    for line in shown:
        found = [other for other in printed.splitlines() if NUMBER.sub("", other.strip()) == NUMBER.sub("", line)]
        assert any(_same_numbers(line, other) for other in found), f"{line!r} is shown, {found} were printed"


def _same_numbers(line, other):
    pairs = zip(NUMBER.findall(line), NUMBER.findall(other), strict=True)
    return all(abs(float(a) - float(b)) <= max(ROUNDED * abs(float(a)), _last_digit(a)) for a, b in pairs)


def _last_digit(number):
    """1e-08 for 1.22e-06; 0 for whole numbers, which are counts."""
    digits, _, power = number.partition("e")
    if not power and "." not in digits:
        return 0.0
    return 1.001 * 10.0 ** (int(power or 0) - len(digits.partition(".")[2]))  # 1.001: a difference is rounded itself
