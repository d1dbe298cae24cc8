"""XML as TinyXML2 reads it, which is the parser of libsdformat: what Gazebo opens is read, what it
refuses is refused.

It is more tolerant than XML. Names with prefixes are plain text, a comment may hold `--`, an
attribute may hold `<`, an `&` that begins no reference is text, and text and elements may stand
beside the root. Elements know their bytes, so that a world can be written as it was. Entities are
never expanded, and a DOCTYPE is refused.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING
from xml.etree import ElementTree
from xml.parsers import expat

# Maximum nesting depth, as in TinyXML2 and far above that of real worlds: readers recurse once for
# each level.
DEEPEST = 100
BYTE_ORDER_MARK = b"\xef\xbb\xbf"
_NAME = rb"[A-Za-z_:\x80-\xff][A-Za-z0-9_:.\x80-\xff-]*+"
_TAG = re.compile(rb"<\s*+(/?)(" + _NAME + rb")")
_ATTRIBUTE = re.compile(rb"\s*+(" + _NAME + rb""")\s*+=\s*+(?:"([^"]*+)"|'([^']*+)')""")
_HALF_ATTRIBUTE = re.compile(rb"\s*+(" + _NAME + rb")\s*+(=?)\s*+([\"']?)")
_TAG_END = re.compile(rb"\s*+(/?)>")
_VISIBLE = re.compile(rb"\S")
_CONTROL = re.compile(rb"[\x00-\x08\x0b\x0c\x0e-\x1f]")
_DECLARATION = re.compile(rb"<\?xml[\s?]")
_ENCODING = re.compile(rb"""\s*<\?xml\s[^>]*?encoding\s*=\s*["']([^"'>]*)["']""")
_REFERENCE = re.compile(r"&(?:#x([0-9a-fA-F]+)|#([0-9]+)|(quot|amp|apos|lt|gt));")
_NAMED = {"quot": '"', "amp": "&", "apos": "'", "lt": "<", "gt": ">"}
_NO_DOCTYPE = (
    "DOCTYPE is not allowed (its entities can read other files and exhaust memory); remove it"
)


class NotXml(Exception):
    """Text that cannot be read: `why`, and at which `line` and `column`, counted from 1.

    The message has all of this. Of a fault of the whole file, line and column are 0.
    """

    def __init__(self, why: str, line: int = 0, column: int = 0) -> None:
        super().__init__(f"line {line}, column {column}: {why}" if line else why)
        self.why = why
        self.line = line
        self.column = column


class Element(ElementTree.Element):
    """An XML element with its file (`source`), its first `line`, its byte range (`start`, `end`)
    there, and its `parent`.

    Its `text` is what stands before its first child. There are no `tail`s.
    """

    __slots__ = ("end", "line", "parent", "source", "start")

    source: Path
    line: int
    start: int
    end: int
    parent: Element | None

    # All elements below an Element are Elements.
    if TYPE_CHECKING:

        def find(self, path: str, namespaces: dict[str, str] | None = None) -> Element | None: ...
        def findall(self, path: str, namespaces: dict[str, str] | None = None) -> list[Element]: ...  # type: ignore[override]  # narrower
        def iter(self, tag: str | None = None) -> Iterator[Element]: ...  # type: ignore[override]  # narrower
        def __iter__(self) -> Iterator[Element]: ...
        def __getitem__(self, index: int) -> Element: ...  # type: ignore[override]  # no slices


def parse_xml(text: bytes, source: Path, root: str = "") -> Element:
    """The first element called `root` that stands in no other one, or else the first of any name.
    Raises NotXml.
    """
    if text.startswith((b"\xff\xfe", b"\xfe\xff")) or b"\0" in text[:100]:
        raise NotXml("is UTF-16, UTF-32 or not text; save it as UTF-8")
    start = len(BYTE_ORDER_MARK) if text.startswith(BYTE_ORDER_MARK) else 0
    scanner = _Scanner(text=text, source=source, encoding=_encoding(text, start), at=start)
    if control := _CONTROL.search(text):
        raise scanner.fault(control.start(), f"a control character (byte 0x{ord(control[0]):02x})")
    scanner.run()
    if not scanner.roots:
        raise scanner.fault(len(text), "no element found")
    return next((each for each in scanner.roots if each.tag == root), scanner.roots[0])


def strict_fault(text: bytes) -> NotXml | None:
    """Where and why a parser that keeps to the standard refuses `text`, which `parse_xml` reads;
    None if it reads it, too.
    """
    begins = len(text) - len(text.removeprefix(BYTE_ORDER_MARK).lstrip())
    if not text.startswith(b"<", begins):
        # Of this expat would only say that it is not well-formed, and not always where.
        return _located(text, begins, "text before the first element")
    parser = expat.ParserCreate(namespace_separator=" ")
    try:
        parser.Parse(text, True)
    except expat.ExpatError as error:
        return NotXml(expat.ErrorString(error.code), error.lineno, error.offset + 1)
    except (LookupError, ValueError):
        return NotXml("unknown encoding", 1, 1)
    return None


def _located(text: bytes, at: int, why: str) -> NotXml:
    """The error `why` at byte `at`."""
    line_start = text.rfind(b"\n", 0, at) + 1
    column = len(text[line_start:at].removeprefix(BYTE_ORDER_MARK).decode("utf-8", "replace")) + 1
    return NotXml(why, text.count(b"\n", 0, at) + 1, column)


def _encoding(text: bytes, start: int) -> str:
    """The encoding that the declaration names, by default UTF-8. Raises NotXml for one that does
    not extend ASCII.
    """
    named = _ENCODING.match(text, start)
    if named is None:
        return "utf-8"
    name = named[1].decode("ascii", "replace")
    # Some programs write UTF-8 and call it UTF-16.
    if name.lower().startswith("utf"):
        return "utf-8"
    try:
        characters = bytes(range(256)).decode(name, "replace")
    except (LookupError, ValueError):
        characters = ""
    if len(characters) != 256 or not characters.startswith(bytes(range(128)).decode()):
        raise NotXml(
            f"cannot be decoded: the encoding '{name[:40]}' is not supported; save it as UTF-8"
        )
    return name


@dataclass(kw_only=True)
class _Scanner:
    """Reads `text` from byte `at` on. `open` are the elements around it, `words` the text so far of
    the innermost one.
    """

    text: bytes
    source: Path
    encoding: str
    at: int
    roots: list[Element] = field(default_factory=list)
    open: list[Element] = field(default_factory=list)
    words: list[str] = field(default_factory=list)
    # `line` is the one of the byte `counted`.
    line: int = 1
    counted: int = 0
    may_declare: bool = True

    def run(self) -> None:
        """Fills `roots`. Raises NotXml."""
        while (start := self.text.find(b"<", self.at)) >= 0:
            self._add_text(start)
            kind = self.text[start + 1 : start + 2]
            if kind == b"!":
                self._skip_markup(start)
            elif kind == b"?":
                self._skip_instruction(start)
            elif not self._read_tag(start):
                return
        if self.open:
            raise self.fault(self.open[-1].start, f"<{_short(self.open[-1].tag)}> has no end tag")
        rest = _VISIBLE.search(self.text, self.at)
        if self.roots and rest is not None:
            raise self.fault(rest.start(), "text after the last element")

    def fault(self, at: int, why: str) -> NotXml:
        """The error of what TinyXML2 refuses, at byte `at`."""
        return _located(self.text, at, f"not well-formed XML: {why}")

    def _add_text(self, end: int) -> None:
        """Adds the text up to byte `end` to the innermost element, if it stands before its first
        child.
        """
        if not self.open:
            self.may_declare = self.may_declare and not self.text[self.at : end].strip()
        elif end > self.at and not len(self.open[-1]):
            self.words.append(self._decoded(self.at, end))

    def _skip_markup(self, start: int) -> None:
        """Skips a comment, or anything else that begins with `<!`; a CDATA section is text. Raises
        NotXml.
        """
        text = self.text
        if text[start + 2 : start + 9].upper() == b"DOCTYPE":
            raise _located(self.text, start, _NO_DOCTYPE)
        self.may_declare = False
        if text.startswith(b"<!--", start):
            self.at = self._after(b"-->", start, 4, "a comment")
        elif text.startswith(b"<![CDATA[", start):
            self.at = self._after(b"]]>", start, 9, "a CDATA section")
            if self.open and not len(self.open[-1]):
                self.words.append(_plain_newlines(self._raw(start + 9, self.at - 3)))
        else:
            self.at = self._after(b">", start, 2, "what begins with '<!'")

    def _skip_instruction(self, start: int) -> None:
        if _DECLARATION.match(self.text, start) and not self.may_declare:
            raise self.fault(start, "the declaration <?xml ...?> must come first")
        self.at = self._after(b"?>", start, 2, "what begins with '<?'")

    def _after(self, end: bytes, start: int, skipped: int, what: str) -> int:
        """Where the next `end` ends; `what` begins at `start` with `skipped` bytes of its own.
        Raises NotXml.
        """
        found = self.text.find(end, start + skipped)
        if found < 0:
            raise self.fault(start, f"{what} is not closed by '{end.decode()}'")
        return found + len(end)

    def _read_tag(self, start: int) -> bool:
        """Reads a start or end tag. False for an end tag outside of all elements, where TinyXML2
        stops. Raises NotXml.
        """
        self.may_declare = False
        found = _TAG.match(self.text, start)
        if found is None:
            raise self.fault(start, "a '<' that begins no tag; write &lt; for the character")
        is_end = bool(found[1])
        name = self._raw(*found.span(2))
        attributes = self._attributes(found.end(), name)
        closes = _TAG_END.match(self.text, self.at)
        if closes is None:
            raise self._unfinished_tag(start, name)
        self.at = closes.end()
        if not is_end:
            self._open(name, attributes, start)
            if closes[1]:
                self._close()
            return True
        if closes[1]:
            raise self.fault(start, f"</{_short(name)}/> is both an end tag and an empty element")
        if not self.open:
            return False
        innermost = self.open[-1]
        if innermost.tag != name:
            raise self.fault(
                start,
                f"</{_short(name)}> closes <{_short(innermost.tag)}> of line {innermost.line}",
            )
        self._close()
        return True

    def _attributes(self, at: int, tag: str) -> dict[str, str]:
        """The attributes from byte `at` on, which moves behind them. Raises NotXml."""
        attributes: dict[str, str] = {}
        while found := _ATTRIBUTE.match(self.text, at):
            name = self._raw(*found.span(1))
            if name in attributes:
                raise self.fault(
                    found.start(1), f"attribute '{_short(name)}' is given twice in <{_short(tag)}>"
                )
            attributes[name] = self._decoded(*found.span(found.lastindex or 2), in_attribute=True)
            at = found.end()
        self.at = at
        return attributes

    def _unfinished_tag(self, start: int, tag: str) -> NotXml:
        """What is wrong with the tag that begins at byte `start` and has been read up to `at`."""
        half = _HALF_ATTRIBUTE.match(self.text, self.at)
        if half is None:
            rest = _VISIBLE.search(self.text, self.at)
            if rest is None:
                return self.fault(start, f"the tag <{_short(tag)} is not closed by '>'")
            why = f"expected an attribute or '>' in the tag <{_short(tag)}"
            return self.fault(rest.start(), why)
        name = _short(half[1].decode(self.encoding, "replace"))
        why = "has no value"
        if half[3]:
            why = "has no closing quote"
        elif half[2]:
            why = "has no quotes around its value"
        return self.fault(half.start(1), f"attribute '{name}' in <{_short(tag)}> {why}")

    def _open(self, tag: str, attributes: dict[str, str], start: int) -> None:
        self.line += self.text.count(b"\n", self.counted, start)
        self.counted = start
        element = Element(tag, attributes)
        element.source = self.source
        element.line = self.line
        element.start = start
        element.parent = self.open[-1] if self.open else None
        if element.parent is None:
            self.roots.append(element)
        else:
            self._set_text(element.parent)
            element.parent.append(element)
        self.open.append(element)
        if len(self.open) > DEEPEST:
            raise _located(self.text, start, f"elements are nested more than {DEEPEST} deep")

    def _close(self) -> None:
        element = self.open.pop()
        self._set_text(element)
        element.end = self.at

    def _set_text(self, element: Element) -> None:
        if self.words:
            element.text = "".join(self.words)
            self.words.clear()

    def _raw(self, start: int, end: int) -> str:
        try:
            return self.text[start:end].decode(self.encoding)
        except UnicodeDecodeError as error:
            why = f"a byte that is not {self.encoding.upper()}; save the file as UTF-8"
            raise self.fault(start + error.start, why) from None

    def _decoded(self, start: int, end: int, *, in_attribute: bool = False) -> str:
        """Text with line ends and references as XML has them. Raises NotXml."""
        words = _plain_newlines(self._raw(start, end))
        if in_attribute:
            words = words.replace("\n", " ").replace("\t", " ")
        if "&" not in words:
            return words

        def character(reference: re.Match[str]) -> str:
            hexadecimal, decimal, name = reference.groups()
            if name:
                return _NAMED[name]
            digits = (hexadecimal or decimal).lstrip("0") or "0"
            # Python refuses to read a thousand digits.
            code = int(digits[:8], 16 if hexadecimal else 10)
            if not _is_character(code):
                at = self.text.find(reference.group().encode(), start)
                raise self.fault(at, f"{reference.group()[:20]} is no character")
            return chr(code)

        return _REFERENCE.sub(character, words)


def _plain_newlines(words: str) -> str:
    return words.replace("\r\n", "\n").replace("\r", "\n")


def _is_character(code: int) -> bool:
    """Whether XML has the character `code`: control characters and halves of pairs are none."""
    return (
        code in (0x9, 0xA, 0xD)
        or 0x20 <= code <= 0xD7FF
        or 0xE000 <= code <= 0xFFFD
        or 0x10000 <= code <= 0x10FFFF
    )


def _short(name: str) -> str:
    return name[:60]
