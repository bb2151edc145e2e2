/* Twin of runtime/control/wall_following/wall_track.py: the filter of distance, heading and trim. */

#include "arrays.h"
#include "constants.h"

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
