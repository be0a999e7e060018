"""Pages that hold everything and need nothing: templates in one look, tables, figures inside."""

import base64
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from importlib import resources
from typing import Any

from jinja2 import Environment, PackageLoader, StrictUndefined, Template
from markupsafe import Markup
from matplotlib.figure import Figure

from hopping_leg.figures import encode


def page_template(package: str, name: str) -> Template:
    """Return a template of a package, which finds others beside it and the look as ``style``."""
    environment = Environment(
        loader=PackageLoader(package, ""),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
    )
    look = resources.files("hopping_leg") / "report.css"
    environment.globals["style"] = Markup(look.read_text(encoding="utf-8"))
    return environment.get_template(name)


def data_uri(content: bytes, kind: str) -> str:
    """Return content as an address that carries it."""
    return f"data:{kind};base64,{base64.b64encode(content).decode()}"


def svg_uri(figure: Figure) -> str:
    """Return a figure as an address that carries it."""
    return data_uri(encode(figure, "svg"), "image/svg+xml")


@dataclass(frozen=True)
class Column:
    """One column: heading, how a row becomes text, and when that deserves attention."""

    heading: str
    text: Callable[[Any], str]
    bad: Callable[[Any], bool] = lambda _row: False


_TABLE = Environment(autoescape=True, trim_blocks=True, lstrip_blocks=True).from_string("""\
<div class="wide"><table>
<tr>
{% for c in columns %}<th>{{ c.heading.replace(" / ", " /\N{NO-BREAK SPACE}") }}</th>{% endfor %}
</tr>
{% for row in rows %}
<tr class="{{ 'first' if loop.changed(columns[0].text(row)) }}">
{% for c in columns %}<td class="{{ 'bad' if c.bad(row) }}">{{ c.text(row) }}</td>{% endfor %}
</tr>
{% endfor %}
</table></div>""")


def table(columns: Sequence[Column], rows: Sequence[Any]) -> Markup:
    """Return an HTML table; a line sets off where the first column changes."""
    return Markup(_TABLE.render(columns=columns, rows=rows) if rows else "")
