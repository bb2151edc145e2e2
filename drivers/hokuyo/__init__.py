"""Hokuyo scanning lidars that speak SCIP 2.x over Ethernet, USB or RS-232 (UST-10LX/20LX, URG-04LX, UTM-30LX).

Read in this order: `settings`, `codec` (lines and blocks, pure), `replies` (what PP, VV, II and status codes say),
`ranges` (scan data to metres), `timing` (is this scan fresh, and ours?), `conversation` (one question, one answer),
`stream` (the hot path), `driver` (connect, watch, recover, for ever).
"""
