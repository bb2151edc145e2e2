/* Twins of runtime/control/wall_following/ball_drive.py (with ball_law.py) and wall_track.py: dozens of steps on numbers. */

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

/* Inputs of the steering besides the ball's path; see pursuit_steering. */
struct aim {
    double error, heading, straight, steering;
};

/* v: error, line_rad, line_error, mean_bend, speed, kp, kd, wheelbase; line_rad is NaN where no line is tracked. */
static struct aim pursue(const double *radius, const double *bearing, const npy_bool *crosses, int circles,
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
    double now = sqrt(SPEED_PROFILE_LATERAL_SHARE * mu * SPEED_PROFILE_GRAVITY_MPS2 / curvature);
    wanted = lesser(wanted, now);
    wanted = lesser(wanted, fastest(radius, bearing, meets, crosses, circles, speed, mu));
    return Py_BuildValue("(dddd)", aim.error, aim.straight, steering, wanted);
}

/* A WallTrack's state, in the order of its tuple. */
enum { D, A, TRIM, DD, AA, DA, DT, AT_, TT, UNREST, WHEEL, NEW, STATES };

static PyObject *state_of(const double *s) {
    return Py_BuildValue("(dddddddddddd)", s[D], s[A], s[TRIM], s[DD], s[AA], s[DA], s[DT], s[AT_], s[TT], s[UNREST],
                         s[WHEEL], s[NEW]);
}

static double square(double value) { return value * value; }

/* predict_wall(state, way, wheel, speed, wheelbase, least unrest) -> state */
KERNEL(predict_wall) {
    double s[MAX_NUMBERS], v[5];
    if (!enough(count, 6, "predict_wall") || !same_count(given[0], STATES, s) || !as_numbers(given + 1, 5, v))
        return NULL;
    double way = v[0], wheel = v[1], speed = v[2], wheelbase = v[3];
    double turn = way * tan(wheel + s[TRIM]) / wheelbase, chord = turn / 2 - s[A];
    double late = WALL_TRACK_LATE_SCANS * way * fabs(wheel - s[WHEEL]) / wheelbase;
    double unrest = greater(fabs(turn), WALL_TRACK_CALM_SHARE * greater(s[UNREST], v[4]));
    double along = way * cos(chord), by_trim = -way / wheelbase;
    if (s[NEW] || unrest * speed * speed > WALL_TRACK_STRAIGHT_WITHIN_MPS2 * way)
        s[DT] = s[AT_] = by_trim = 0.0;
    double at = s[AT_] + by_trim * s[TT], aa = s[AA] + by_trim * (s[AT_] + at);
    double da = s[DA] + along * s[AA] + by_trim * (s[DT] + along * s[AT_]);
    s[DD] += along * (2 * s[DA] + along * s[AA]);
    s[DD] += square(WALL_TRACK_STEP_STD_M + WALL_TRACK_DRIFT_PER_TURN_M * fabs(turn));
    s[DT] += along * s[AT_];
    s[AT_] = at;
    s[DA] = da;
    s[AA] = aa + square(WALL_TRACK_STEP_STD_RAD + WALL_TRACK_SLIP_PER_TURN * unrest + late);
    s[TT] = lesser(s[TT] + square(WALL_TRACK_TRIM_STEP_STD_RAD), square(WALL_TRACK_TRIM_START_STD_RAD));
    s[D] -= way * sin(chord);
    s[A] -= turn;
    s[UNREST] = unrest;
    s[WHEEL] = wheel;
    s[NEW] = 0.0;
    return state_of(s);
}

static void move(double *s, double gd, double ga, double gt, double surprise) {
    s[D] += gd * surprise;
    s[A] += ga * surprise;
    s[TRIM] = bounded(s[TRIM] + gt * surprise, -WALL_TRACK_MAX_TRIM_RAD, WALL_TRACK_MAX_TRIM_RAD);
}

/* correct_wall(state, distance, heading) -> state */
KERNEL(correct_wall) {
    double s[MAX_NUMBERS], v[2];
    if (!enough(count, 3, "correct_wall") || !same_count(given[0], STATES, s) || !as_numbers(given + 1, 2, v))
        return NULL;
    double share = 1.0 / (s[DD] + square(WALL_TRACK_LINE_STD_M));
    double gd = s[DD] * share, ga = s[DA] * share, gt = s[DT] * share;
    move(s, gd, ga, gt, v[0] - s[D]);
    s[AA] -= ga * s[DA];
    s[AT_] -= ga * s[DT];
    s[TT] -= gt * s[DT];
    s[DA] -= gd * s[DA];
    s[DT] -= gd * s[DT];
    s[DD] -= gd * s[DD];
    share = 1.0 / (s[AA] + square(WALL_TRACK_LINE_STD_RAD));
    gd = s[DA] * share, ga = s[AA] * share, gt = s[AT_] * share;
    move(s, gd, ga, gt, v[1] - s[A]);
    s[DD] -= gd * s[DA];
    s[DT] -= gd * s[AT_];
    s[TT] -= gt * s[AT_];
    s[DA] -= ga * s[DA];
    s[AT_] -= ga * s[AT_];
    s[AA] -= ga * s[AA];
    return state_of(s);
}
