"""A number that remembers how large the terms were that it is a sum of."""


class Sized:
    """A value and its size, the sum of the magnitudes of its terms.

    Round-off in a difference is small against its terms, not against its value. Of functions that
    do arithmetic only, ``function(Sized(x)).size`` is what a tolerance has to be relative to.

    Parameters
    ----------
    value : float
        The number.
    size : float, optional
        Its size; by default its magnitude, as for a number that is no sum.
    """

    def __init__(self, value, size=None):
        self.value = value
        self.size = abs(value) if size is None else size

    def __add__(self, other):
        other = _sized(other)
        return Sized(self.value + other.value, self.size + other.size)

    def __mul__(self, other):
        other = _sized(other)
        return Sized(self.value * other.value, self.size * other.size)

    def __pow__(self, power):
        # a root or a quotient keeps the relative error of what it is taken of
        relative = self.size / abs(self.value) if self.value else 1.0
        value = self.value ** _sized(power).value
        return Sized(value, abs(value) * relative)

    def __neg__(self):
        return -1.0 * self

    def __sub__(self, other):
        return self + -_sized(other)

    def __rsub__(self, other):
        return -self + other

    def __truediv__(self, other):
        return self * _sized(other) ** -1.0

    def __rtruediv__(self, other):
        return self**-1.0 * other

    __radd__ = __add__
    __rmul__ = __mul__


def _sized(number):
    return number if isinstance(number, Sized) else Sized(number)
