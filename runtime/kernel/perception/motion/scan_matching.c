/* Twin of runtime/control/perception/motion/scan_matching.py: a scan laid over the surfaces of an earlier one. */

#include "arrays.h"
#include "constants.h"
#include "steps.h"

/* Both scans of one sensor, (beams,): the points of this one, and the surfaces of the earlier one. */
struct scans {
    struct row x, y, range, solid, at, normal, flat;
    double lidar_x, lidar_y, first, step;
};

/* The beam of a lidar toward a place, -1 where it has none; NaN is such a place. */
beam beam_toward(double x, double y, double first, double step, beam count) {
    double number = rint((atan2(y, x) - first) / step);
    return number >= 0.0 && number < (double)count ? (beam)number : -1;
}

/* One point that fits its line: turned, its arm from the pose; off, its distance along the normal. */
void tell(struct told *told, place normal, place turned, double off, double weight) {
    const double slope[3] = {creal(normal), cimag(normal), creal(turned) * cimag(normal) - cimag(turned) * creal(normal)};
    told->fits++;
    for (int k = 0; k < 3; k++) {
        told->pull[k] += slope[k] * off * weight;
        for (int j = 0; j < 3; j++)
            told->information[3 * k + j] += slope[k] * slope[j] * weight;
    }
}

static struct told paired(const struct scans *s, const double *pose, double gate) {
    struct told told = {{0.0}, {0.0}, 0, 0};
    const beam part = s->solid.count / SCAN_MATCHING_POINTS, every = part > 1 ? part : 1;
    const place turn = CMPLX(cos(pose[2]), sin(pose[2])), moved = CMPLX(pose[0], pose[1]);
    const double noise2 = SCAN_MATCHING_NOISE_M * SCAN_MATCHING_NOISE_M;
    for (beam i = 0; i < s->solid.count; i += every) {
        double range = NUMBER(s->range, i);
        if (!FLAG(s->solid, i) || !(range > SCAN_MATCHING_MIN_RANGE_M && range < SCAN_MATCHING_MAX_RANGE_M))
            continue;
        place turned = times(CMPLX(NUMBER(s->x, i), NUMBER(s->y, i)), turn), there = turned + moved;
        beam beside = beam_toward(creal(there) - s->lidar_x, cimag(there) - s->lidar_y, s->first, s->step, s->flat.count);
        if (beside <= 0 || !FLAG(s->flat, beside))
            continue;
        told.lines++;
        place normal = PLACE(s->normal, beside), apart = times(there - PLACE(s->at, beside), conj(normal));
        if (!(fabs(creal(apart)) < gate && fabs(cimag(apart)) < SCAN_MATCHING_ALONG_M))
            continue;
        tell(&told, normal, turned, creal(apart), 1.0 / noise2);
    }
    return told;
}

/* The information of the guess, for that heading. drift: its deviations ahead, aside and in heading. */
static void prior_of(double yaw, const double *drift, double *to) {
    const double ahead = 1.0 / (drift[0] * drift[0]), aside = 1.0 / (drift[1] * drift[1]), c = cos(yaw), s = sin(yaw);
    to[0] = c * c * ahead + s * s * aside;
    to[1] = to[3] = c * s * (ahead - aside);
    to[4] = s * s * ahead + c * c * aside;
    to[8] = 1.0 / (drift[2] * drift[2]);
    to[2] = to[5] = to[6] = to[7] = 0.0;
}

/* Whether the scene alone determines the shift to the side of that heading, and the turn. */
static int is_sure(const struct told *told, double yaw) {
    double m[9], aside[3], turn[3], way[3] = {sin(yaw), -cos(yaw), 0.0}, about[3] = {0.0, 0.0, -1.0};
    for (int i = 0; i < 9; i++)
        m[i] = told->information[i] + (i % 4 == 0 ? 1.0 : 0.0);
    solve_three(m, way, aside);
    solve_three(m, about, turn);
    return sqrt(-(way[0] * aside[0] + way[1] * aside[1])) < SCAN_MATCHING_SURE_M && sqrt(turn[2]) < SCAN_MATCHING_SURE_RAD;
}

/* match_scan(x, y, range, solid, lidar x, lidar y, first angle, angle step, points, normals, flat, guess x, y, yaw, *drift)
 *     -> x, y, yaw, sure | None */
KERNEL(match_scan) {
    struct scans s;
    double lidar[4], guess[3], drift[3], off[3] = {0.0}, prior[9], pose[3] = {0.0};
    if (!enough(count, 17, "match_scan") || !as_row(given[0], NPY_DOUBLE, &s.x) || !as_row(given[1], NPY_DOUBLE, &s.y) ||
        !as_row(given[2], NPY_DOUBLE, &s.range) || !as_row(given[3], NPY_BOOL, &s.solid) ||
        !as_numbers(given + 4, 4, lidar) || !as_row(given[8], NPY_CDOUBLE, &s.at) ||
        !as_row(given[9], NPY_CDOUBLE, &s.normal) || !as_row(given[10], NPY_BOOL, &s.flat) ||
        !as_numbers(given + 11, 3, guess) || !as_numbers(given + 14, 3, drift))
        return NULL;
    const beam many = s.solid.count;
    if (s.x.count != many || s.y.count != many || s.range.count != many || s.at.count != s.flat.count ||
        s.normal.count != s.flat.count)
        return PyErr_Format(PyExc_ValueError, "match_scan: arrays of different lengths");
    s.lidar_x = lidar[0], s.lidar_y = lidar[1], s.first = lidar[2], s.step = lidar[3];
    const double gates[3] = {SCAN_MATCHING_GATES_M_0, SCAN_MATCHING_GATES_M_1, SCAN_MATCHING_GATES_M_2};
    struct told told;
    prior_of(guess[2], drift, prior);
    for (int step = 0; step < 3; step++) {
        double sum[9], toward[3], move[3];
        for (int i = 0; i < 3; i++)
            pose[i] = guess[i] + off[i];
        told = paired(&s, pose, gates[step]);
        if (told.fits < SCAN_MATCHING_ENOUGH_POINTS)
            Py_RETURN_NONE;
        for (int i = 0; i < 3; i++) {
            toward[i] = told.pull[i];
            for (int j = 0; j < 3; j++) {
                sum[3 * i + j] = told.information[3 * i + j] + prior[3 * i + j];
                toward[i] += prior[3 * i + j] * off[j];
            }
        }
        if (!solve_three(sum, toward, move))
            return NULL;
        for (int i = 0; i < 3; i++)
            off[i] += move[i];
    }
    if ((double)told.fits / (double)told.lines < SCAN_MATCHING_ENOUGH_SHARE)
        Py_RETURN_NONE;
    return Py_BuildValue("(dddN)", guess[0] + off[0], guess[1] + off[1], guess[2] + off[2],
                         PyBool_FromLong(is_sure(&told, pose[2])));
}
