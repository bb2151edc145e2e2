/* Steps of runtime/control/wall_following/ball_law.py: the steering towards the ball's path. */

#include "arrays.h"
#include "constants.h"
#include "steps.h"

static double asin_of(double sine) { return asin(bounded(sine, -1.0, 1.0)); }

static double fading(double value, double whole_below, double none_above) {
    return bounded((none_above - value) / (none_above - whole_below), 0.0, 1.0);
}

/* path: the path's own curvature; see approach_rad. */
static double approach(double error, double speed, double slope, double path) {
    double sharpest = 1.0 / (BALL_LAW_ARC_M + BALL_LAW_ARC_S * fabs(speed));
    double against = lesser(copysign(path, error * path), 0.0);
    double bend = greater(sharpest + against, BALL_LAW_MIN_ARC_SHARE * sharpest), size = fabs(error), wanted = slope * size;
    double joint = slope > 0 ? asin(lesser(bend / slope, 1.0)) : HUGE_VAL;
    if (wanted > joint)
        wanted = acos(greater(cos(joint) - bend * (size - joint / slope), -1.0));
    return copysign(lesser(wanted, BALL_LAW_MAX_SLOPE_RAD), error);
}

/* Share of full lock for the corners ahead; see turn_share. */
static double share_of_turn(const double *radius, const double *bearing, const npy_bool *crosses, int circles,
                            double speed) {
    double size = fabs(speed), turn = BALL_LAW_TURN_M + BALL_LAW_TURN_S * size, share = 0.0, x0 = 0.0, y0 = 0.0;
    int begun = 0, all = circles < (int)BALL_LAW_TURN_CIRCLES ? circles : (int)BALL_LAW_TURN_CIRCLES;
    for (int i = 0; i < all && !(begun && !crosses[i]); i++) {
        if (!crosses[i])
            continue;
        double x = radius[i] * cos(bearing[i]), y = radius[i] * sin(bearing[i]), chord = atan2(y - y0, x - x0);
        if (begun && -BALL_LAW_TURN_TO_RAD < chord && chord < -BALL_LAW_TURN_FROM_RAD) {
            double cosine = cos(chord), sine = sin(chord);
            double left = (cosine * y - sine * x - turn * (1.0 - cosine)) / -sine - BALL_LAW_TURN_AHEAD_S * size;
            double sharp = (-chord - BALL_LAW_TURN_FROM_RAD) / (BALL_LAW_TURN_WHOLE_RAD - BALL_LAW_TURN_FROM_RAD);
            share = greater(share, lesser(sharp, 1.0) * fading(left, 0.0, BALL_LAW_TURN_RAMP_M));
        }
        begun = 1, x0 = x, y0 = y;
    }
    return share;
}

/* v: error, line_rad, line_error, mean_bend, speed, kp, kd, wheelbase; line_rad is NaN where no line is tracked. */
struct aim pursue(const double *radius, const double *bearing, const npy_bool *crosses, int circles,
                         const double *v) {
    struct aim aim = {.error = v[0], .straight = 0.0};
    const double line_rad = v[1], line_error = v[2], speed = v[4], kd = v[6];
    const double here = radius[circles - 3], twice = radius[circles - 2], near = radius[circles - 1];
    const double near_rad = bearing[circles - 1];
    double from_here = bearing[circles - 3] - asin_of(aim.error / here);
    double from_twice = bearing[circles - 2] - asin_of(aim.error / twice);
    double beside = crosses[circles - 3] ? fading(fabs(aim.error), BALL_LAW_HERE_WHOLE * here, BALL_LAW_HERE_NONE * here)
                                         : 0.0;
    double bend = bounded(2.0 * (from_twice - from_here) / (twice - here), BALL_LAW_MIN_BEND_PER_M,
                          BALL_LAW_MAX_BEND_PER_M);
    double from_near = near_rad - asin_of(aim.error / near);
    aim.heading = from_near + beside * (from_here - from_near);
    if (!isnan(line_rad)) {
        double expected = bounded(line_rad + asin_of(line_error / near), -BALL_PATH_MAX_ANGLE_RAD, BALL_PATH_MAX_ANGLE_RAD);
        aim.straight = fading(fabs(near_rad - expected), BALL_LAW_STRAIGHT_RAD, BALL_LAW_NOT_STRAIGHT_RAD);
        aim.straight *= fading(fabs(v[3]), BALL_LAW_STRAIGHT_PER_M, BALL_LAW_BENT_PER_M);
        aim.error += aim.straight * (line_error - aim.error);
        aim.heading += aim.straight * (line_rad - aim.heading);
    }
    aim.heading = lesser(aim.heading, near_rad - asin_of(aim.error / near) + BALL_LAW_NOT_TOWARDS_RAD);
    double slower = BALL_LAW_SLOW_MPS / greater(fabs(speed), BALL_LAW_SLOW_MPS);
    double slope = slower * v[5] / greater(kd, 1e-6);
    double wanted = approach(aim.error, speed, slope, (1.0 - aim.straight) * v[3]) + aim.heading;
    double slip = BALL_LAW_SLIP_S2_PER_M + BALL_LAW_SLIP_S3_PER_M2 * fabs(speed);
    wanted += (1.0 - aim.straight) * beside * slip * speed * speed * bend;
    double rough = lesser(BALL_LAW_ROUGH_KD_SHARE, slower);
    aim.steering = kd * (rough + aim.straight * (slower - rough)) * wanted;
    double turn = -atan(v[7] / (BALL_LAW_TURN_M + BALL_LAW_TURN_S * fabs(speed)));
    aim.steering += share_of_turn(radius, bearing, crosses, circles, speed) * lesser(turn - aim.steering, 0.0);
    return aim;
}
