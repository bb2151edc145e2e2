"""The follower `corridor`: drives fast by both borders of the course, without a map. Pure, without a clock.

Read in this order: `borders` (what is left and right of the way on), `marching` (a way in the middle between them),
`bending` (the way that bends least), `kept_way` (the way from scan to scan), `way_speed` (how fast it may be driven),
`corridor_follower` (what is made of it all).
"""
