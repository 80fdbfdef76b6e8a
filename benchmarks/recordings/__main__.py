"""Recordings: killed processes, replays, and the effect of lossy images on the detection.

``--kills 100``: a process records at 100 Hz with 25 images per second and is killed with SIGKILL at
a random time; what is missing in the log. ``--replays 50``: replayed runs of the twin.
``--images 300``: image formats; detection in original and coded images. ``--video 25``: lossless
video; of the twin with ``--noise``, or with ``--folder`` of the images there.
"""

import argparse
import json
import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

import cv2
from recordings.kills import kills
from recordings.runs import images, replays
from recordings.video import video_formats


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawTextHelpFormatter
    )
    parser.add_argument("--kills", type=int, default=0, metavar="N")
    parser.add_argument("--replays", type=int, default=0, metavar="N")
    parser.add_argument("--images", type=int, default=0, metavar="N")
    parser.add_argument("--video", type=int, default=0, metavar="N")
    parser.add_argument("--noise", type=float, metavar="S", help="image noise [grey levels]")
    parser.add_argument("--folder", type=Path, metavar="DIR", help="folder of images")
    parser.add_argument("--seconds", type=float, default=5.0, help="duration of a replayed run")
    arguments = parser.parse_args()
    cv2.setNumThreads(1)
    if arguments.images:
        for row in images(arguments.images):
            print(json.dumps(row), flush=True)
    if arguments.video:
        for row in video_formats(arguments.video, arguments.folder, arguments.noise):
            print(json.dumps(row), flush=True)
    if arguments.replays:
        print(json.dumps(replays(arguments.replays, arguments.seconds)), flush=True)
    if arguments.kills:
        print(json.dumps(kills(arguments.kills)), flush=True)


if __name__ == "__main__":
    main()
