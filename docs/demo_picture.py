"""Draw docs/demo.svg: the demonstration as it looks half way and at its end, from a real run."""

from __future__ import annotations

import asyncio
import io
import re
from pathlib import Path

from rich.console import Console, Group

from compax_aio.cli.demo import run

_HALF_WAY_FRAME = 90


def main() -> None:
    """Run the demonstration and keep one frame and the table."""
    picture = Console(record=True, width=88, file=io.StringIO(), force_terminal=True)
    frames = 0

    def on_frame(screen: Group) -> None:
        nonlocal frames
        frames += 1
        if frames == _HALF_WAY_FRAME:
            picture.print("[bold green]$[/] make demo")
            picture.print(screen)

    table = asyncio.run(run(Console(file=io.StringIO()), on_frame))
    picture.print(table)
    # The picture asks nobody for a font.
    drawing = re.sub(r"@font-face \{.*?\}\s*", "", picture.export_svg(title="compax_aio"), flags=re.DOTALL)
    Path(__file__).with_name("demo.svg").write_text(drawing.replace("Fira Code", "DejaVu Sans Mono"), encoding="utf-8")


if __name__ == "__main__":
    main()
