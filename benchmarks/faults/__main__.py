"""The fault campaign: how far faults move the tip, and whether they are detected.

Every run is compared with the fault-free run: same instrument, noise and motion. 10 mm of slack,
estimated before the fault; a reference of up to 12.6 mm/s. `--kind K --seed S` repeats one run.
"""

import json
import sys
from datetime import UTC, datetime
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from common.doc_pages import insert
from common.processes import Results
from faults import tables
from faults.campaign import PAGE, Options, arguments, measure, merge, read, section
from faults.scenarios import DURATION


def main() -> None:
    options = arguments()
    done = Results() if options.read else measure(options)
    found = read(options.read) if options.read else merge(done.values())
    if options.json:
        options.json.write_text(json.dumps(found), encoding="utf-8")
    each_off = {name.removeprefix("-"): rows for name, rows in found.items() if name[:1] == "-"}
    parts = {}
    for name, rows in found.items():
        if name[:1] == "-":
            continue
        is_long = options.longest != DURATION[1]
        shown = tables.beyond(rows) if name or is_long else tables.table(rows)
        goals = "" if name else f" {tables.goals(options.profile)}"
        text = f"{tables.summary(rows)}{goals}\n\n{shown}"
        print(f"{name or 'guarded'}: {text}\n")
        parts[section(options, name)] = f"{conditions(options, name)}\n\n{text}"
    if each_off:
        text = tables.off_table(each_off)
        print(text)
        parts["faults each"] = f"{conditions(options, 'each')}\n\n{text}"
    if options.kind and options.seed is not None:
        print(json.dumps(next(iter(found.values())), indent=1))
    done.require_all()
    for title, text in parts.items() if options.write else ():
        insert(PAGE, title, text)


def conditions(options: Options, name: str) -> str:
    """Return the conditions and the date of a table."""
    today = datetime.now(UTC).date().isoformat()
    monitors = {
        "": "All detectors on",
        "unguarded": "All detectors off",
        "each": "One detector off in turn",
    }
    monitor = monitors.get(name, name + " off")
    durations = f"transient faults of {DURATION[0]:g} to {options.longest:g} s"
    return f"{monitor}, profile `{options.profile}`, {durations}, {today}."


if __name__ == "__main__":
    main()
