"""The VESC's fault codes as text, each with its remedy (`datatypes.h`, mc_fault_code)."""

_REPAIR = "repair or replace the VESC"
_PHASES = "check the motor cables and repeat the motor detection"
_ENCODER = "check the encoder cable, or set the motor to sensorless"
_SETUP = "run the motor wizard again"

_FAULTS = {
    1: "over voltage: braking into a full battery; lower the brake current",
    2: "under voltage: charge or change the battery",
    3: f"gate driver fault: if it comes back, {_REPAIR}",
    4: f"over-current: {_PHASES}",
    5: "VESC too hot: let it cool, give it air",
    6: "motor too hot: let it cool, drive gentler or change the gearing",
    7: f"gate driver over voltage: {_REPAIR}",
    8: f"gate driver under voltage: {_REPAIR}",
    9: "controller under voltage: its supply dipped; check the battery and its plugs",
    10: "restarted by its watchdog: update the firmware if it comes back",
    11: f"encoder does not answer: {_ENCODER}",
    12: f"encoder signal too weak: {_ENCODER}",
    13: f"encoder signal too strong: {_ENCODER}",
    14: "flash memory corrupted: write the firmware again",
    15: f"current sensor 1 has a wrong offset: {_REPAIR}",
    16: f"current sensor 2 has a wrong offset: {_REPAIR}",
    17: f"current sensor 3 has a wrong offset: {_REPAIR}",
    18: f"unbalanced currents: a phase wire is loose; {_PHASES}",
    19: "brake line active: check the brake input",
    20: f"resolver lost tracking: {_ENCODER}",
    21: f"resolver signal degraded: {_ENCODER}",
    22: f"resolver signal lost: {_ENCODER}",
    23: "application settings lost: servo output is off now; write the application configuration again",
    24: f"motor settings lost: limits are wrong now; {_SETUP}",
    25: f"encoder sees no magnet: {_ENCODER}",
    26: f"encoder magnet too strong: {_ENCODER}",
    27: f"phase filter fault: {_REPAIR}",
    28: f"encoder fault: {_ENCODER}",
    29: f"low-voltage output fault: {_REPAIR}",
    30: f"encoder slipped: {_ENCODER}",
    31: f"overspeed: check the speed limits; {_SETUP}",
    32: f"underspeed: check the speed limits; {_SETUP}",
    33: f"absolute overspeed: check the speed limits; {_SETUP}",
}


def fault_text(code: int) -> str:
    """Return the meaning and remedy of a fault code; "" for 0, and a sentence for unknown future codes too."""
    if code == 0:
        return ""
    return _FAULTS.get(code, f"fault {code}: look it up in VESC Tool (terminal command 'faults')")
