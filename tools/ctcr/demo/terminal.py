"""The story on a terminal: each command as it is typed, then what it found."""

from ctcr.demo.story import Step


class Teller:
    """Prints the steps of a story, numbered."""

    def __init__(self, console):
        self._console, self._number = console, 0

    def begins(self, why: str, command: str) -> None:
        self._number += 1
        self._console.print(f"[bold]{self._number:2}. {why}[/bold]")
        self._console.print(f"    $ {command}", style="dim", markup=False)

    def ended(self, step: Step) -> None:
        self._console.print(f"    {step.found} ({step.seconds:.0f} s)", style="green", markup=False)
