"""One term changed in every equation of the estimators: do their tests notice?"""

from collections.abc import Iterator, Mapping

from tests.mutation.rewrite import Mutant, mutants
from tests.mutation.running import Tests

ROOM = "gimbalcal."
HOME = "tests/estimate/"
TESTS: Mapping[str, tuple[str, ...]] = {  # of each module, the ones that end soonest first
    "estimate.accelerometers.coarse": ("accelerometers/test_terms.py", "accelerometers/test_coarse.py"),
    "estimate.accelerometers.fine": ("accelerometers/test_terms.py", "accelerometers/test_fine.py"),
    "estimate.accelerometers.joint": ("accelerometers/test_joint.py",),
    "estimate.accelerometers.position_fit": (
        "accelerometers/test_errors_in_variables.py", "accelerometers/test_noise.py",
        "accelerometers/test_positions.py", "accelerometers/test_terms.py",
    ),
    "views.local": (
        "accelerometers/test_errors_in_variables.py", "accelerometers/test_terms.py", "accelerometers/test_noise.py",
        "accelerometers/test_position_outliers.py",
    ),
    "views.positions": (
        "accelerometers/test_terms.py", "accelerometers/test_errors_in_variables.py", "accelerometers/test_joint.py",
    ),
    "estimate.static_run.force_filter": ("static_run/test_terms.py", "static_run/test_force_filter.py"),
    "estimate.static_run.combined_coefficients": ("static_run/test_combined_coefficients.py",),
    "estimate.static_run.system": ("static_run/test_terms.py", "static_run/test_system.py", "test_fusion.py"),
    "views.known_attitude": ("static_run/test_terms.py", "static_run/test_system.py"),
}  # fmt: skip


def changed_terms(module: str, per_statement: int) -> Iterator[tuple[Mutant, Tests]]:
    """Mutants of a module of `TESTS`, so many of each statement, each with the tests of the module."""
    tests = tuple(HOME + path for path in TESTS[module])
    for mutant in mutants(ROOM + module, per_statement):
        yield mutant, tests
