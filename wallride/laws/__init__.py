"""Names for laws of your own: what a law is given, and what it answers. See docs/your-own-law.md."""

from wallride.runtime.control.own_laws.api import LawGuidance as Guidance
from wallride.runtime.control.own_laws.api import LawLimit as Limit
from wallride.runtime.control.own_laws.api import LawScan as Scan
from wallride.runtime.control.own_laws.api import LawSettings
from wallride.runtime.control.own_laws.api import LawState as State
from wallride.runtime.control.vehicle import CarSettings

__all__ = ["CarSettings", "Guidance", "LawSettings", "Limit", "Scan", "State"]
