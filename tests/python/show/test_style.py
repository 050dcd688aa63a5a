"""What a reader sees in a picture is text, not the source of a formula."""

import pytest
from ctcr.show import style


@pytest.mark.parametrize("scale", ["linear", "log", "symlog"])
def test_ticks(scale):
    """The ticks of every kind of axis are plain numbers."""

    def plot(figure, values):
        axes = figure.subplots()
        axes.plot(values, values)
        axes.set(xscale=scale, yscale=scale)

    picture = style.draw(plot, [0.02, 30.0], 4, 3)
    assert ">10</text>" in picture and "math" not in picture
