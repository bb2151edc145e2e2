/* Twins of runtime/control/ball_drive.py (with ball_law.py) and wall_track.py: dozens of steps on numbers. */

#include "arrays.h"
#include "constants.h"
#include "steps.h"

static double asin_of(double sine) { return asin(bounded(sine, -1.0, 1.0)); }

static double fading(double value, double whole_below, double none_above) {
    return bounded((none_above - value) / (none_above - whole_below), 0.0, 1.0);
}

static double slower(double speed) { return BALL_LAW_SLOW_MPS / greater(fabs(speed), BALL_LAW_SLOW_MPS); }

static double approach(double error, double speed, double slope) {
    double bend = 1.0 / (BALL_LAW_ARC_M + BALL_LAW_ARC_S * fabs(speed)), size = fabs(error), wanted = slope * size;
    double joint = slope > 0 ? asin(lesser(bend / slope, 1.0)) : HUGE_VAL;
    if (wanted > joint)
        wanted = acos(greater(cos(joint) - bend * (size - joint / slope), -1.0));
    return copysign(lesser(wanted, BALL_LAW_STEEPEST_RAD), error);
}

static double bend_correction(double bend, double look, double speed, double kd, double wheelbase) {
    double share = (bend + BALL_LAW_KINKED_ABOVE_PER_M) / (BALL_LAW_KINKED_ABOVE_PER_M - BALL_LAW_SMOOTH_BELOW_PER_M);
    double curvature = lesser(bend * bounded(share, 0.0, 1.0), BALL_LAW_TIGHTEST_PER_M);
    double on_arc = asin_of(curvature * look / 2) - BALL_LAW_SLIP_S2_PER_M * speed * speed * curvature;
    return atan(wheelbase * curvature) - slower(speed) * kd * on_arc;
}

/* v: near_m, near_rad, far_m, far_rad, error, line_rad, line_error, mean_bend, bend, speed, kp, kd, wheelbase; line_rad
 * is NaN where no line is tracked. to: error, heading, straight, steering. */
void pursue(const double *v, double *to) {
    double near = v[0], near_rad = v[1], error = v[4], line_rad = v[5], line_error = v[6], speed = v[9], kd = v[11];
    double heading = near_rad - asin_of(error / near), straight = 0.0;
    if (!isnan(line_rad)) {
        double expected = bounded(line_rad + asin_of(line_error / near), -BALL_LAW_WIDEST_RAD, BALL_LAW_WIDEST_RAD);
        straight = fading(fabs(near_rad - expected), BALL_LAW_STRAIGHT_RAD, BALL_LAW_NOT_STRAIGHT_RAD);
        straight *= fading(fabs(v[7]), BALL_LAW_STRAIGHT_PER_M, BALL_LAW_BENT_PER_M);
        error += straight * (line_error - error);
        heading += straight * (line_rad - heading);
    }
    heading = lesser(heading, v[3] - asin_of(error / v[2]) + BALL_LAW_CORNER_AT_LEAST_RAD);
    double slope = slower(speed) * v[10] / greater(kd, 1e-6);
    double steering = slower(speed) * kd * (approach(error, speed, slope) + heading);
    if (straight < 1.0)
        steering += (1.0 - straight) * bend_correction(v[8], near, speed, kd, v[12]);
    to[0] = error, to[1] = heading, to[2] = straight, to[3] = steering;
}

/* driven_along((radius, ...), (bearing, ...), (meets, ...), (crosses, ...), error, line_rad, line_error, mean_bend, bend,
 * speed, kp, kd, wheelbase, trim, most_rad, wanted, mu) -> error, straight, steering, speed */
KERNEL(driven_along) {
    double radius[MOST_NUMBERS], bearing[MOST_NUMBERS], v[17], aim[4];
    npy_bool meets[MOST_NUMBERS], crosses[MOST_NUMBERS];
    if (!enough(count, 17, "driven_along") || !as_numbers(given + 4, 13, v + 4))
        return NULL;
    int circles = numbers_of(given[0], radius);
    if (circles < 0 || !same_count(given[1], circles, bearing) || !flags_of(given[2], circles, meets) ||
        !flags_of(given[3], circles, crosses))
        return NULL;
    if (circles < 2)
        return PyErr_Format(PyExc_ValueError, "driven_along wants at least two circles");
    v[0] = radius[circles - 2], v[1] = bearing[circles - 2], v[2] = radius[circles - 1], v[3] = bearing[circles - 1];
    pursue(v, aim);
    double speed = v[9], wheelbase = v[12], most_rad = v[14], wanted = v[15], mu = v[16];
    double steering = bounded(aim[3] - v[13], -most_rad, most_rad);
    if (isinf(mu))
        return Py_BuildValue("(dddd)", aim[0], aim[2], steering, wanted);
    if (steering <= -most_rad && aim[0] < -BALL_DRIVE_TOO_NEAR_M && aim[1] < 0.0)
        mu *= BALL_DRIVE_SLIPPING_SHARE;
    double curvature = greater(fabs(tan(steering)) / wheelbase, 1e-6);
    double now = sqrt(SPEED_PROFILE_LATERAL_SHARE * mu * SPEED_PROFILE_GRAVITY_MPS2 / curvature);
    wanted = lesser(wanted, now);
    wanted = lesser(wanted, fastest(radius, bearing, meets, crosses, circles, speed, mu));
    return Py_BuildValue("(dddd)", aim[0], aim[2], steering, wanted);
}

/* A WallTrack's state, in the order of its tuple. */
enum { D, A, TRIM, DD, AA, DA, DT, AT_, TT, UNREST, WHEEL, NEW, STATES };

static PyObject *state_of(const double *s) {
    return Py_BuildValue("(dddddddddddd)", s[D], s[A], s[TRIM], s[DD], s[AA], s[DA], s[DT], s[AT_], s[TT], s[UNREST],
                         s[WHEEL], s[NEW]);
}

static double square(double value) { return value * value; }

/* predicted(state, way, wheel, speed, wheelbase, least unrest) -> state */
KERNEL(predicted) {
    double s[MOST_NUMBERS], v[5];
    if (!enough(count, 6, "predicted") || !same_count(given[0], STATES, s) || !as_numbers(given + 1, 5, v))
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
    s[TRIM] = bounded(s[TRIM] + gt * surprise, -WALL_TRACK_MOST_TRIM_RAD, WALL_TRACK_MOST_TRIM_RAD);
}

/* corrected(state, distance, heading) -> state */
KERNEL(corrected) {
    double s[MOST_NUMBERS], v[2];
    if (!enough(count, 3, "corrected") || !same_count(given[0], STATES, s) || !as_numbers(given + 1, 2, v))
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
