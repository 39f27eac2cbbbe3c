"""Check the dimensions in all equations of a module type."""

from collections.abc import Iterable, Mapping

from rulec.knowledge.knowledge import FaultType
from rulec.knowledge.module_type import ENDS, ModuleType
from rulec.language.diagnostics import Diagnostic, Place
from rulec.language.dimension import dimension
from rulec.language.expression import Rejected, constant
from rulec.language.read_yaml import Document
from rulec.language.reader import Reader
from rulec.language.units import SECOND, UNKNOWN, VOLUME_FLOW, Dimension, UnitTable


def provided_names(
    documents: Iterable[Document], units: UnitTable, found: list[Diagnostic]
) -> dict[str, Dimension]:
    """Dimension of each name that module types provide; they must agree on it."""
    result: dict[str, Dimension] = {}
    first: dict[str, Place] = {}
    for document in documents:
        for name, signal in document.data.get("provides", {}).items():
            if signal not in document.data.get("signals", {}):
                continue
            own = Reader(document, units, []).unit("signals", signal, "unit").dimension
            if not own.fits(result.get(name, own)):
                message = f"'{name}' is {own} here, but {result[name]} in another module"
                hint = "what is summed must be of one kind"
                path = ("provides", name)
                Reader(document, units, found).report_key(path, "KB058", message, hint, first[name])
            result.setdefault(name, own)
            first.setdefault(name, document.key("provides", name))
    return result


def check_equations(
    reader: Reader,
    module: ModuleType,
    provided: Mapping[str, Dimension],
    faults: Mapping[str, FaultType],
) -> None:
    """Check the dimensions in a module type, if its document has no mistakes so far; `provided`
    gives those of downstream sums."""
    if reader.is_refused:
        return
    dimensions = {**_declared(module), **dict.fromkeys(ENDS, VOLUME_FLOW)}
    gathered = {name: provided.get(name, UNKNOWN) for name in module.gathers}
    for path, expression in module.equations_at():
        group, name, key = path[0], str(path[1]), str(path[2])
        for used, column in expression.gathered():
            reader.knows(path, provided, "KB056", "no module type provides '{}'", used, column)
        own = reader.dimension(path, expression, dimensions, gathered)
        wanted, code = VOLUME_FLOW, "KB057"
        if group == "definitions":
            dimensions[name] = own
            wanted = VOLUME_FLOW if name in ENDS else UNKNOWN
            template = f"'{name}' is a volume flow, but this is {{own}}"
        elif group == "observers":
            template = "an observer gives a volume flow ({wanted}), but this is {own}"
        else:
            per = {"der": dimensions[name] / SECOND, "after": SECOND}
            # A bare number fits every dimension.
            is_bare = constant(expression, {}) is not None
            wanted = UNKNOWN if is_bare else per.get(key, dimensions[name])
            code, template = "KB112", "this is {own}, but should be {wanted}"
        if not own.fits(wanted):
            message = template.format(own=own, wanted=wanted)
            reader.report(path, code, message, "check each factor")
    for regime in module.regimes.values():
        for i, condition in enumerate(regime.when):
            try:
                dimension(condition.margin, dimensions, {})
            except Rejected:
                path = ("regimes", regime.name, "when", i)
                message = f"'{condition.text}' compares what is of different kinds"
                reader.report(path, "KB127", message, "check each factor")
    for use in module.faults:
        fault, own = faults[use.fault], dimensions.get(use.target, UNKNOWN)
        if reader.units.quantities.get(fault.not_of) == own:
            message = f"'{fault.name}' acts on no {fault.not_of}, but '{use.target}' is one"
            hint = f"its degree is the {fault.variants[0].meaning}; take what that is true of"
            reader.found.append(Diagnostic(use.place, "KB048", message, hint))


def _declared(kind: ModuleType) -> dict[str, Dimension]:
    """Dimension of each signal, parameter and state."""
    groups = (kind.signals, kind.parameters, kind.states)
    return {name: part.unit.dimension for group in groups for name, part in group.items()}


def dimensions_of(
    kind: ModuleType, gathered: Mapping[str, Dimension] | None = None
) -> dict[str, Dimension]:
    """Dimension of each signal, parameter, state and definition; `gathered`: of downstream sums."""
    sums = dict.fromkeys(kind.gathers, UNKNOWN) if gathered is None else gathered
    dimensions = {**_declared(kind), **(dict.fromkeys(ENDS, VOLUME_FLOW) if kind.flows else {})}
    for definition in kind.definitions.values():  # in order of use
        dimensions[definition.name] = dimension(definition.expression, dimensions, sums)
    return dimensions
