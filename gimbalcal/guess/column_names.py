"""Columns of a log by their names, as loggers, laboratories and people write them."""

from __future__ import annotations

import re
import unicodedata
from collections.abc import Container, Iterable, Iterator, Mapping, Sequence
from dataclasses import replace

from gimbalcal.guess.log import Guess
from gimbalcal.quantities import QUANTITIES
from gimbalcal.recording.record import FORCE, RATE

AXIS = {"x": "x", "y": "y", "z": "z", "0": "x", "1": "y", "2": "z"}


def by_spelling(spellings: Mapping[str, str]) -> dict[str, str]:
    """Return the meaning of each spelling; spellings: by meaning, separated by blanks."""
    return {spelling: meaning for meaning, all_of_it in spellings.items() for spelling in all_of_it.split()}


# Words of English, German, French, Italian, Portuguese and Spanish, as `plain_name` leaves them.
_TIME = re.compile(
    r"^(time|times|timestamp|timestamps|stamp|clock|date_time|date|datetime|utc|zeit|zeitstempel|messzeit|uhrzeit|temps|heure"
    r"|hora|tiempo|tempo|ora|tijd|epoch|mjd|jd|yday|doy|jday|decimal_day|gps_sow|gps_tow|sow|tow|itow|t|ts|sec|secs|seconds"
    r"|millis|milliseconds|micros|microseconds|nanos|nanoseconds|ms|us|ns|s|elapsed|seconds_elapsed)(_|$)"
)
_DIFFERENCE = frozenset(["diff", "difference", "differenz", "skew"])
AXES_OF_A_TRIAD = ("xyz", "012", "123", "456", "abc")
_FORCE_WORDS = (
    "linear_acceleration|lin_acc|linacc|accelerometer_acceleration|accelerometer|acceleration|accelero|accel|accl|acc"
    "|beschleunigung|beschl|aceleracion|aceleracao|acelerometro|accelerazione|accelerometro|accelerometre"
    "|specific_force|spezifische_kraft|force|kraft|fs|fb|gf|f|a"
)
_RATE_WORDS = (
    "angular_velocity|angular_rate|ang_vel|angvel|ang_v|ang_rate|gyro_rotation|rotation_rate|rot_rate|rotate|gyroscope|gyro|gyr|omega|angular"
    "|drehrate|winkelgeschwindigkeit|vitesse_angulaire|velocidad_angular|velocidade_angular|velocita_angolare"
    "|giroscopio|gyrometre|giro|rate|om|rot|wb|w|g"
)
_QUALIFIERS = (
    "smooth|adc|raw|filtered|filt|unfilt|lpf|data|out|output|mean|avg|average|mittel|sensor|val|value|meas|imu"
)
_AXIS_FIRST = {
    quantity: re.compile(rf"^([xyz])_(?:axis_|achse_)?({words})(_|$)")
    for quantity, words in (
        (FORCE, "accel|acc|accelerometer|acceleration|force|beschleunigung"),
        (RATE, "gyro|gyr|gyroscope|angular_rate|angular_velocity|rate|drehrate"),
    )
}
_LETTER_AND_UNIT = re.compile(r"^[a-z0-9_]*?([xyz])_([a-z0-9_]+)$")
_OWN_ESTIMATE = re.compile(
    r"(^|_)(roll|pitch|yaw|euler|eul|heading|attitude|orientation|quat|quaternion)(_|$)|^(angle|ang|winkel)_?[xyz](_|$)"
)
_BARE = re.compile(r"^(?:(?:axis|achse|values?|measurement|data)_)?([xyz]|(?<=_)[012])(?:_(?:axis|achse))?(_|$)")
_BODY = {"p": "x", "q": "y", "r": "z"}  # roll, pitch and yaw rate of a vehicle
_TEMPERATURE = re.compile(  # gtemp, imu_temp1: what has it may be written before, and its number behind
    r"(^|_)([a-z]*temp(erature|eratur)?|tmp)\d*(_|$)|^(t_(deg_)?[cfk]|t_(degc|celsius|degf))$"
)
_COUNTER = re.compile(
    r"(^|_)(packet|sample|frame|index|idx|counter|seq|sequence|row|line|loop|iteration|loop_iteration|record|zaehler)"
    r"(_(number|no|nr|num|counter|count|index|id))?$"
)
_ANONYMOUS = re.compile(r"(col|column|field|var|variable|ch|channel|data|value|val|unnamed|spalte|v|c|x)?_*\d+|[a-z]|")
_POSITION = re.compile(
    r"^(position|pos|posture|station|rest|segment|lage|stellung|nr|no|number|nummer|orientation_no|pt|point|punkt|pose"
    r"|attitude_no|face|setup)(_(no|nr|number|id))?$"
)
_COUNTS = re.compile(r"^(n|samples|count|counts|anzahl|nsamples|n_samples|nobs)$")
_SCATTER = re.compile(
    r"^(s|u|sd|std|stdev|stddev|std_dev|sigma|sig|stabw|standardabweichung|unsicherheit|uncertainty|unc|rms|err|error)_(.+)$"
)
_SCATTER_BEHIND = re.compile(r"^(.+?)_(sd|std|stdev|stddev|sigma|stabw|standardabweichung|err|error)((?:_.*)?)$")
_ALL_OF_IT = re.compile(r"^(f|a|acc|accel|force|kraft|beschleunigung|specific_force)(_|$)")  # of a triad
_GIMBAL = by_spelling(
    {
        "platform": "platform plattform",
        "inner": "inner innen innere innerer",
        "middle": "middle mid mitte mittlere mittlerer",
        "outer": "outer aussen aeussere aussere ausserer",
        "table": "table tisch drehtisch turntable",
    }
)
_TURN = by_spelling(
    {
        "roll": "roll rollwinkel",
        "pitch": "pitch nick nickwinkel",
        "tilt": "tilt kippwinkel neigung",
        "yaw": "yaw gier gierwinkel heading",
        "table": "drehwinkel",
    }
)
_TURNS_BY = re.compile(r"(^|_)(rate|speed|velocity|vel|omega|drehrate|drehzahl|geschwindigkeit|rpm|vitesse)(_|$)")
_COMMANDS = re.compile(r"(^|_)(cmd|command|commanded|setpoint|set|soll|sollwert|target|demand|ref|nominal)(_|$)")
_OTHER_WORDS = (
    "cov covariance orientation quat quaternion mag magnetometer magnetic std sd sigma stdev var variance bias drift "
    "user status quality euler attitude setpoint command cmd saturation clip clipping lon lat long longitude latitude "
    "easting northing gps gnss matrix dcm baro pressure magn vicon"
)
NOT_A_TRIAD = frozenset(_OTHER_WORDS.split())  # words of columns that are no reading of a triad
_UNITS = by_spelling(
    {
        "m/s^2": "m_s2 ms2 mps2 m_s_2 m_s_s m_sec2 m_sec_2",
        "g": "g gs",
        "mg": "mg",
        "ug": "ug",
        "Gal": "gal cm_s2",
        "mGal": "mgal",
        "ft/s^2": "ft_s2 fts2 fps2 ft_s_2 ft_sec2 ft_s_s ft_sec_2",
        "deg/s": "dps deg_s deg_s_1 degs deg_per_s deg_sec deg_second",
        "deg/h": "deg_h dph deg_hr deg_hour",
        "rad/s": "rad_s rad_s_1 rads rad_sec rad_per_s rad_per_sec rps",
        "count": "lsb count counts raw adc digits",
        "mdeg/s": "mdps mdeg_s",
        "s": "s sec seconds secs sekunden",
        "ms": "ms msec millis milliseconds",
        "us": "us usec micros microseconds",
        "ns": "ns nsec nanos nanoseconds",
        "min": "min",
        "h": "h hours hour hrs",
        "degC": "degc c celsius grad_c",
        "K": "k",
        "degF": "degf f",
        "deg": "deg degrees degree grad",
        "rad": "rad radians",
        "arcsec": "arcsec as asec arcseconds",
        "arcmin": "arcmin amin arcminutes",
        "mrad": "mrad",
        "mdeg": "mdeg",
        "gon": "gon",
        "d": "mjd jd days yday doy jday decimal_day",
    }
)
ANGLES = ("rad", "mrad", "deg", "mdeg", "gon", "arcmin", "arcsec")  # units of the angles of a rig or a mount
ANGLE_WORDS = frozenset(["angle", "winkel", "theta", "phi"])
_TURNED = ("rad", "deg", "mdeg")  # behind the name of a gyroscope: in a second
_QUANTITY_OF_UNIT = {
    **dict.fromkeys(("m/s^2", "g", "mg", "ug", "Gal", "mGal", "ft/s^2"), FORCE),
    **dict.fromkeys(("deg/s", "deg/h", "rad/s", "mdeg/s", "rev/min"), RATE),
}
_UNIT_BEFORE_AXIS = {  # accelerometer_m_s2[0], gyro_rad[0] of a rate
    FORCE: "m_s2|mps2|mg|ug|g|mgal",
    RATE: "rad_s|rads|rad|deg_s|dps|deg|mdps|deg_h|dph",
}
_TRIADS = {
    quantity: re.compile(
        rf"^({words})_?(?:(?:{_QUALIFIERS})_)?(?:\d+_?(?=[xyz]))?(?:(?P<unit>{_UNIT_BEFORE_AXIS[quantity]})_)?(axis_|achse_)?"
        "(?P<axis>[xyz012])(_|$)"  # a number before the letter of an axis is that of the sensor, accel_2_x
    )
    for quantity, words in ((FORCE, _FORCE_WORDS), (RATE, _RATE_WORDS))
}
_INCREMENTS = {
    quantity: re.compile(rf"^({words})_?(?:(?:{_QUALIFIERS})_)?(?P<axis>[xyz012])(_|$)")
    for quantity, words in (
        (RATE, "(?:delta|del|d)_?(?:theta|angle|ang|wb|w)|ang(?:le|ular)?_incr?(?:ement)?"),
        (FORCE, "(?:delta|del|d)_?(?:velocity|vel|vb|v)|vel(?:ocity)?_incr?(?:ement)?"),
    )
}
_LETTERS = by_spelling(
    {"ss": "ß", " deg ": "°", " arcsec ": "″", " arcmin ": "′", "u": "µ μ", "": "^", " alpha ": "α", " beta ": "β"}
    | {" gamma ": "γ", " theta ": "θ ϑ", " phi ": "φ ϕ", " psi ": "ψ", " omega ": "ω Ω", " delta ": "δ Δ"}
)


def plain_name(name: str) -> str:
    """Return a name in lower case, without accents, one underscore for whatever separates words.

    >>> [plain_name(n) for n in ("Acc_X [m/s^2]", " linear_acceleration.x", "GyroX(dps)", "Außen [°]")]
    ['acc_x_m_s2', 'linear_acceleration_x', 'gyro_x_dps', 'aussen_deg']
    """
    name = re.sub("°\\s*([CFK])\\b", r" deg\1", name)
    name = re.sub(r"[\[(]\s*'\s*[\])]", " arcmin ", re.sub(r"[\[(]\s*(\"|'')\s*[\])]", " arcsec ", name))
    for letter, spelt in _LETTERS.items():
        name = name.replace(letter, spelt)
    name = "".join(c for c in unicodedata.normalize("NFKD", name) if not unicodedata.combining(c))
    name = re.sub(r"([a-z]{2})([A-Z])", r"\1_\2", name.strip())  # GyroX, accelerationX, TimeUS
    name = re.sub(r"([a-z_][XYZ])([A-Z][a-z])", r"\1_\2", name)  # AccelXMps2
    return re.sub(r"_+", "_", re.sub(r"[^a-z0-9]+", "_", name.lower())).strip("_")


def unit_written(words: str) -> str:
    """Return the unit that the last words of a plain name spell, or the empty string."""
    parts = words.split("_")
    return next((u for k in range(len(parts)) if (u := _UNITS.get("_".join(parts[k:])))), "")


def is_counter(name: str) -> bool:
    """Return whether a name is that of a count of rows, packets or frames, which is no clock."""
    return _COUNTER.search(plain_name(name)) is not None


def states_other_unit(name: str) -> bool:
    """Return whether a name is an angle's, or states a unit in brackets that is not one of time: "yaw [deg]" grows."""
    words = plain_name(name)
    unit = unit_written(words) if re.search(r"[\[(]", name) else ""
    return unit not in ("", "s", "ms", "us", "ns", "min", "h", "d") or bool(ANGLE_WORDS.intersection(words.split("_")))


def is_anonymous(name: str) -> bool:
    """Return whether a name says nothing: a number, a letter, "col 3", "field2".

    >>> [is_anonymous(n) for n in ("7", "col 3", "longitude", "v0", "M11")]
    [True, True, False, True, False]
    """
    return _ANONYMOUS.fullmatch(plain_name(name)) is not None


def is_unit(cell: str) -> bool:
    """Return whether a cell spells a unit and nothing else."""
    return plain_name(cell) in _UNITS


def by_name(name: str, hint: str = "") -> Guess | None:
    """Return the guess by a column's name, or None; hint: quantity of a log whose columns are called x, y and z."""
    words, why = plain_name(name), f"its name {name.strip()!r}"
    if _COUNTS.match(words):
        return Guess("weight", "", "", why)
    if scattered := _SCATTER.match(words) or _SCATTER_BEHIND.match(words):
        of = scattered[2] if _SCATTER.match(words) else scattered[1] + scattered[3]
        inner = by_name(of)
        if inner and inner.quantity in (FORCE, RATE):
            return Guess("sigma", inner.axis, inner.unit, why) if inner.quantity == FORCE else None
        if whole := _ALL_OF_IT.match(of):
            return Guess("sigma", "", unit_written(_rest(of, whole)), why)
    member = plain_name(name.rpartition(".")[2])  # meas.t: of a structure
    if (timed := _time(words)) is not None or (timed := _time(member)) is not None:
        return Guess("time", "", timed, why)
    if _TEMPERATURE.search(words) and not NOT_A_TRIAD.intersection(words.split("_")):
        unit = unit_written(words)
        known = unit if unit in QUANTITIES["temperature"].units else "degC"  # temp_h is that of a hygrometer
        return None if unit == "count" else Guess("temperature", "", known, why)
    if _POSITION.match(words):
        return Guess("position", "", "", why)
    if (increment := _increment(words, why)) is not None:
        return increment
    triad = _triad(words)
    if triad:
        return Guess(*triad, why)
    if (gimbal := axis_word(name)) and not rate_word(name) and unit_written(words) not in _QUANTITY_OF_UNIT:
        return Guess("gimbal_angle", gimbal, unit_written(words) or "deg", why)
    bare = _BARE.match(words)
    if hint and bare:
        why = f"{why} in a log that is called after the {'accelerometer' if hint == FORCE else 'gyroscope'}"
        return Guess(hint, AXIS[bare[1]], _UNITS.get(_rest(words, bare), ""), why)
    return None


def counted_from_one(names: Iterable[str]) -> dict[str, Guess]:
    """Return triads whose axes are 1, 2 and 3, by name, where others count 0, 1, 2."""
    stems: dict[tuple[str, str], dict[str, str]] = {}
    for name in names:
        if match := re.fullmatch(r"(.*[A-Za-z][_ (\[]?)([0-3])(\D*)", name):
            stems.setdefault((match[1], match[3]), {})[match[2]] = name
    out = {}
    for (before, behind), own in stems.items():
        for axis, digit in zip("xyz", "123", strict=True) if set(own) == set("123") else ():
            guess = by_name(before + axis + behind)
            if guess and guess.quantity in (FORCE, RATE):
                out[own[digit]] = replace(guess, why=f"its name {own[digit].strip()!r}, of three counted from 1")
    return out


def _increment(words: str, why: str) -> Guess | None:
    """Return the guess about a column of increments of angle or velocity; None for others."""
    if NOT_A_TRIAD.intersection(words.split("_")):
        return None
    for quantity, match, rest in _matches(words, _INCREMENTS):
        unit = unit_written(_rest(rest, match))
        return Guess(quantity, AXIS[match["axis"]], unit if unit in ANGLES else "", why, increments=True)
    return None


def _matches(words: str, patterns: Mapping[str, re.Pattern[str]]) -> Iterator[tuple[str, re.Match[str], str]]:
    """Yield quantity and match of words by patterns, and the words from which on they match.

    What stands before, the name of a topic or of a device, does not count.
    """
    parts = words.split("_")
    for k in range(len(parts)):
        rest = "_".join(parts[k:])
        for quantity, pattern in patterns.items():
            if match := pattern.match(rest):
                yield quantity, match, rest


def _triad(words: str) -> tuple[str, str, str] | None:
    """Return quantity, axis and unit of a column of a triad; its unit decides the quantity (Gx in mg)."""
    triad = _triad_by_word(words)
    if triad and triad[2] in _QUANTITY_OF_UNIT:
        return _QUANTITY_OF_UNIT[triad[2]], triad[1], triad[2]
    return triad


def _triad_by_word(words: str) -> tuple[str, str, str] | None:
    """Return quantity, axis and unit of a column of a triad by words alone; None for others."""
    parts = words.split("_")
    if NOT_A_TRIAD.intersection(parts):
        return None
    for quantity, match, rest in _matches(words, _TRIADS):
        unit = unit_written(_rest(rest, match)) or _UNITS.get(match["unit"] or "", "")
        return quantity, AXIS[match["axis"]], f"{unit}/s" if quantity == RATE and unit in _TURNED else unit
    for quantity, axis_first, rest in _matches(words, _AXIS_FIRST):
        return quantity, AXIS[axis_first[1]], _UNITS.get(_rest(rest, axis_first), "")
    letter = _LETTER_AND_UNIT.match(words)  # AsX (deg/s): whatever it is called, the unit says what it is
    if letter and _UNITS.get(letter[2]) in _QUANTITY_OF_UNIT and parts[0] not in ("max", "index"):
        unit = _UNITS[letter[2]]
        return _QUANTITY_OF_UNIT[unit], AXIS[letter[1]], unit
    return None


def body_rates(names: dict[str, str]) -> dict[str, Guess]:
    """Return columns p, q and r of a vehicle's log, where all three exist; names: each as `plain_name` has it."""
    columns = {name: words.split("_") for name, words in names.items() if words.split("_")[0] in _BODY}
    if sorted(parts[0] for parts in columns.values()) != sorted(_BODY):
        return {}
    why = "of roll, pitch and yaw rate"
    return {
        n: Guess(RATE, _BODY[parts[0]], _UNITS.get("_".join(parts[1:]), ""), f"its name {n.strip()!r}, {why}")
        for n, parts in columns.items()
    }


def differ_in_axis(triple: Sequence[str], axes: Container[str] = AXES_OF_A_TRIAD) -> bool:
    """Return whether three names differ in one letter or digit that counts on, as one of these axes do; mere numbers
    are no names.
    """
    a, b, c = (name.lower() for name in triple)
    if a.isdigit() or not len(a) == len(b) == len(c):
        return False
    at = [i for i, letters in enumerate(zip(a, b, c, strict=True)) if len(set(letters)) > 1]
    return bool(at) and all(a[i] + b[i] + c[i] in axes for i in at)


def axis_word(name: str) -> str:
    """Return the axis of a rig that a name contains; empty where it names none, or two."""
    axes = {_GIMBAL[w] for w in plain_name(name).split("_") if w in _GIMBAL}
    return axes.pop() if len(axes) == 1 else ""


def rate_word(name: str) -> bool:
    """Return whether a name is that of a rate, whatever its unit: table_speed, rate_cmd."""
    return _TURNS_BY.search(plain_name(name)) is not None


def is_commanded(name: str) -> bool:
    """Return whether a name is that of a command to a rig, not of a measured motion."""
    return _COMMANDS.search(plain_name(name)) is not None


def is_estimated(name: str) -> bool:
    """Return whether a name is that of an attitude computed by a unit, not of a readout of a rig."""
    return _OWN_ESTIMATE.search(plain_name(name)) is not None


def by_turn(name: str) -> Guess | None:
    """Return a gimbal angle called after its turn, roll, pitch, yaw; in a log it may be an estimate instead."""
    words = plain_name(name)
    axis = next((_TURN[w] for w in words.split("_") if w in _TURN), "")
    return Guess("gimbal_angle", axis, unit_written(words) or "deg", f"its name {name.strip()!r}") if axis else None


def quantity_of_log(stem: str) -> str:
    """Return the quantity that a log is called after: "Gyroscope.csv" holds rates, whatever its columns are."""
    words = plain_name(stem)
    if re.search(r"gyr|giro|drehrate|angular|angolare", words):
        return RATE
    return FORCE if re.search(r"acc|acel|beschl|gravity|force", words) else ""


def _time(words: str) -> str | None:
    """Return the unit of a clock, empty where the name states none; None where it is no clock."""
    parts = words.split("_")
    if _DIFFERENCE.intersection(parts):  # of two clocks
        return None
    for k in range(len(parts)):  # a topic or a device may stand before it
        match = _TIME.match("_".join(parts[k:]))
        if not match or (k and parts[k - 1] == "per"):  # something per second
            continue
        rest = _rest("_".join(parts[k:]), match)
        if len(match[1]) <= 2 and (k or (rest and rest not in _UNITS)):
            return None  # s_x is something of x
        return unit_written(rest) or _UNITS.get(match[1], "")
    return None


def _rest(words: str, match: re.Match[str]) -> str:
    return words[match.end() :].strip("_")
