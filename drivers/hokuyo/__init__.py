"""Hokuyo scanning lidars that speak SCIP 2.x over Ethernet, USB or RS-232 (UST-10LX/20LX, URG-04LX, UTM-30LX).

Read in this order: `settings`, `codec` (lines and blocks, pure), `replies` (meaning of PP, VV, II and status codes),
`ranges` (scan data to metres), `timing` (freshness and origin of a scan), `conversation` (one request, one reply),
`stream` (the hot path), `driver` (connect, monitor, recover, reconnect).
"""
