"""The operator's console: hazards with number of runs and failures, and figures with a browser.

Debian's chromium is needed for --images, --ticks, --warnings, --steer and --hand.

    uv run python benchmarks/console --requests 100000 --stops 300 --write
    uv run python benchmarks/console --images 30 --ticks 60 --warnings 50 --hand 120
"""

import argparse
import json
import sys
import tempfile
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from console import hazards, invalid_requests
from console.pages import SIZES, Page, console, sized
from guarantees import goals
from guarantees.goals import Measurement

SEED = 19


def arguments() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])

    def count(name: str, text: str) -> None:
        parser.add_argument(f"--{name}", type=int, default=0, metavar="N", help=text)

    count("requests", "N1, N2, G20: requests without token, forged or malformed; 100000")
    count("replays", "N5: repeated and old commands; 100")
    count("losses", "N3: pages that fall silent or lose their connection; 100")
    count("networks", "N3, N5: networks that stand for 2 s; 10")
    count("clients", "M1: second pages; 100")
    count("masters", "M1, G21: second programs; 100")
    count("stops", "N4: STOP under load; 300")
    count("load", "busy processes during --stops")
    count("fuzz", "G11: seconds of fuzzing; 600")
    count("images", "seconds of images at each size; 30")
    count("ticks", "seconds of control ticks with and without a browser; 100")
    count("warnings", "U1: warnings until the page shows them; 50")
    count("hand", "seconds of operator motion by a gamepad; 120")
    count("steer", "seconds of steering with each device after every control was used; 60")
    parser.add_argument("--write", action="store_true", help="update docs/safety.md")
    return parser.parse_args()


def measure(options: argparse.Namespace, folder: Path) -> None:
    """The requested goals, each written at once."""

    def add(name: str, result: Measurement) -> None:
        if options.write:
            goals.write({name: result})
        print(json.dumps({"goal": name, **result.__dict__}), flush=True)

    if options.fuzz:
        add("G11", invalid_requests.fuzzing(options.fuzz, SEED))
    if options.masters:
        add("G21", hazards.second_masters(options.masters))
    if any((options.requests, options.replays, options.losses, options.clients, options.stops)):
        config = sized("720x576")
        with console(folder / "hazards", config, "--twin") as (address, _):
            page = Page(address)
            if options.requests:
                add("G20", invalid_requests.requests(address, page, options.requests, SEED))
            page.take()
            if options.stops:
                add("G20b", hazards.stops(address, page, options.stops, options.load))
            if options.replays:
                page.take()
                add("G20e", hazards.replays(page, options.replays))
            if options.clients:
                add("G20d", hazards.second_clients(address, page, options.clients))
            if options.losses:
                add("G20c", hazards.link_losses(address, page, options.losses))
            page.close()
    if options.networks:
        add("G20f", hazards.held_networks(folder / "networks", options.networks))


def main() -> None:
    options = arguments()
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        measure(options, folder)
        if any((options.images, options.ticks, options.warnings, options.steer, options.hand)):
            from console import live  # noqa: PLC0415  playwright

            for size in SIZES if options.images else ():
                result = live.images(folder / f"images-{size}", size, options.images)
                print(json.dumps({"images": size, **result}), flush=True)
            for is_watched in (False, True) if options.ticks else ():
                path = folder / f"ticks-{is_watched}"
                result = live.ticks(path, "720x576", options.ticks, is_watched=is_watched)
                print(json.dumps({"ticks": "page" if is_watched else "no page", **result}))
            if options.warnings:
                result = live.warnings(folder / "warnings", options.warnings)
                print(json.dumps({"warnings": result}), flush=True)
            if options.steer:
                print(
                    json.dumps({"steer": live.steer(folder / "steer", options.steer)}), flush=True
                )
            if options.hand:
                print(json.dumps(live.hand(folder / "hand", options.hand)), flush=True)


if __name__ == "__main__":
    main()
