/* Twin of runtime/control/wall_following/ball_drive.py: steering and speed along the ball's path. */

#include "arrays.h"
#include "constants.h"
#include "steps.h"

/* drive_along_ball((radius, ...), (bearing, ...), (meets, ...), (crosses, ...), error, line_rad, line_error, mean_bend, speed,
 * kp, kd, wheelbase, trim, most_rad, wanted, mu) -> error, straight, steering, speed */
KERNEL(drive_along_ball) {
    double radius[MAX_NUMBERS], bearing[MAX_NUMBERS], v[12];
    npy_bool meets[MAX_NUMBERS], crosses[MAX_NUMBERS];
    if (!enough(count, 16, "drive_along_ball") || !as_numbers(given + 4, 12, v))
        return NULL;
    int circles = numbers_of(given[0], radius);
    if (circles < 0 || !same_count(given[1], circles, bearing) || !flags_of(given[2], circles, meets) ||
        !flags_of(given[3], circles, crosses))
        return NULL;
    if (circles < 3)
        return PyErr_Format(PyExc_ValueError, "driven_along wants at least three circles");
    struct aim aim = pursue(radius, bearing, crosses, circles, v);
    double speed = v[4], wheelbase = v[7], most_rad = v[9], wanted = v[10], mu = v[11];
    double steering = bounded(aim.steering - v[8], -most_rad, most_rad);
    if (isinf(mu))
        return Py_BuildValue("(dddd)", aim.error, aim.straight, steering, wanted);
    if (steering <= -most_rad && aim.error < -BALL_DRIVE_TOO_NEAR_M && aim.heading < 0.0)
        mu *= BALL_DRIVE_SLIPPING_SHARE;
    double curvature = greater(fabs(tan(steering)) / wheelbase, 1e-6);
    double now = sqrt(SPEED_PROFILE_LATERAL_SHARE * mu * VEHICLE_GRAVITY_MPS2 / curvature);
    wanted = lesser(wanted, now);
    wanted = lesser(wanted, fastest(radius, bearing, meets, crosses, circles, speed, mu));
    return Py_BuildValue("(dddd)", aim.error, aim.straight, steering, wanted);
}
