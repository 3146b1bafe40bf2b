"""Copies the pages for users with their pictures into a folder. Links to what does not go with them become plain text.

    python3 .ci/pages.py FOLDER
"""

import pathlib
import re
import shutil
import sys

PAGES = ["README.md", "CHANGELOG.md", *sorted(map(str, pathlib.Path("docs").glob("*.md")))]
PICTURES = [str(path) for path in sorted(pathlib.Path("docs").iterdir()) if path.suffix in (".png", ".svg")]


def linked(page, text):
    """The text with links to the copied files and to the web only."""

    def kept(match):
        mark, words, target = match.groups()
        file = target.partition("#")[0]
        place = (pathlib.Path(page).parent / file).resolve().relative_to(pathlib.Path.cwd()) if "://" not in file else None
        if not file or place is None or str(place) in PAGES + PICTURES:
            return match[0]
        return "" if mark else words

    return re.sub(r"(!?)\[([^\]]*)\]\(([^)\s]+)\)", kept, text)


folder = pathlib.Path(sys.argv[1])
for page in PAGES:
    place = folder / page
    place.parent.mkdir(parents=True, exist_ok=True)
    place.write_text(linked(page, pathlib.Path(page).read_text()))
for picture in PICTURES:
    shutil.copy(picture, folder / picture)
