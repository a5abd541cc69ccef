"""The README as a package index shows it: pictures and pages of the repository, of which it has none, left out."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

from hatchling.metadata.plugin.interface import MetadataHookInterface

_PICTURE = re.compile(r"^!\[[^]]*\]\((?!https:)[^)]*\)\n+", re.M)
_LINK = re.compile(r"(?<!!)\[([^]]*)\]\((?!https:)[^)]*\)")


def for_an_index(text: str) -> str:
    """The text without relative pictures, and with the words of relative links alone."""
    return _LINK.sub(r"\1", _PICTURE.sub("", text))


class CustomMetadataHook(MetadataHookInterface):
    """Gives the project its readme."""

    def update(self, metadata: dict[str, Any]) -> None:
        """Set the readme in the metadata of the project."""
        text = (Path(self.root) / "README.md").read_text(encoding="utf-8")
        metadata["readme"] = {"content-type": "text/markdown", "text": for_an_index(text)}
