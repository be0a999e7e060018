"""XML from anywhere, read within bounds: no entities, no other files, no endless depth."""

import math
from pathlib import Path
from xml.etree import ElementTree as Xml
from xml.parsers import expat

import numpy as np

from hopping_leg.arrays import Array
from hopping_leg.errors import RobotError
from hopping_leg.io import one_line

_LARGEST_FILE = 16 << 20  # bytes
_DEEPEST = 200
_MOST_ELEMENTS = 50_000
_MOST_BODIES = 1000
_LARGEST = 1e9  # magnitude of any number


def parse_xml(path: Path) -> Xml.Element:
    """Return the root of an XML file.

    Raises:
        RobotError: There is no such file, or it is no XML, too large, or declares a document type.
    """
    if not path.is_file():
        raise RobotError(f"There is no file {path}; give a URDF (.urdf) or MJCF (.xml) file.")
    if path.stat().st_size > _LARGEST_FILE:
        raise RobotError(f"{path} is larger than {_LARGEST_FILE >> 20} MiB, which no leg needs.")
    builder, parser = Xml.TreeBuilder(), expat.ParserCreate()
    depth = count = 0

    def start(tag: str, attributes: dict[str, str]) -> None:
        nonlocal depth, count
        depth, count = depth + 1, count + 1
        if depth > _DEEPEST or count > _MOST_ELEMENTS:
            raise RobotError(
                f"{path} nests more than {_DEEPEST} elements or has more than {_MOST_ELEMENTS};"
                " a leg's file needs neither."
            )
        builder.start(tag, attributes)

    def end(tag: str) -> None:
        nonlocal depth
        depth -= 1
        builder.end(tag)

    def refuse(*_: object) -> None:
        raise RobotError(f"{path} declares a document type or entities; remove its <!DOCTYPE>.")

    parser.StartElementHandler, parser.EndElementHandler = start, end
    parser.CharacterDataHandler = builder.data
    parser.StartDoctypeDeclHandler = refuse
    try:
        parser.Parse(path.read_bytes(), True)
    except (expat.ExpatError, ValueError, LookupError) as error:
        raise RobotError(f"{path} is not readable as XML: {one_line(error)}.") from error
    root = builder.close()
    for tag in ("link", "body", "joint", "geom", "actuator"):
        if sum(1 for _ in root.iter(tag)) > _MOST_BODIES:
            raise RobotError(f"{path} has more than {_MOST_BODIES} <{tag}>; a leg needs a few.")
    return root


def numbers(element: Xml.Element, attribute: str, default: tuple[float, ...], where: str) -> Array:
    """Return an attribute's numbers, as many as ``default`` has, which is taken where it is absent.

    Raises:
        RobotError: They are others or not finite; ``where`` begins the sentence.
    """
    text = element.get(attribute)
    if text is None:
        return np.array(default)
    try:
        values = [float(word) for word in text.split()]
    except ValueError:
        values = []
    if len(values) != len(default) or not all(abs(v) < _LARGEST for v in values):
        form = "a number" if len(default) == 1 else f"{len(default)} numbers"
        raise RobotError(
            f"{where}: {attribute} of <{element.tag}> is {one_line(text)} but must be {form}."
        )
    return np.array(values)


def number(element: Xml.Element | None, attribute: str, where: str) -> float | None:
    """Return an attribute's number, None where element or attribute is absent.

    Raises:
        RobotError: It is no finite number; ``where`` begins the sentence.
    """
    if element is None or attribute not in element.attrib:
        return None
    return float(numbers(element, attribute, (math.nan,), where)[0])
