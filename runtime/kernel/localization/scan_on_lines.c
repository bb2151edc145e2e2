/* Twin of runtime/control/localization/scan_on_lines.py: a scan laid over the lines of a map. */

#include "arrays.h"
#include "constants.h"
#include "steps.h"

/* Lines of walls by cell, as LineField. */
struct field {
    struct row near, far, normals, offsets, free;
    double corner_x, corner_y, cell;
    beam rows, columns;
};

/* One beam at a pose: its end there, the distance from its wall, how that changes with the pose, and its kernel. */
struct laid {
    place end;
    double off, slope[3], kernel;
};

static beam cell_of(const struct field *field, place end) {
    double column = (creal(end) - field->corner_x) * (1.0 / field->cell);
    double row = (cimag(end) - field->corner_y) * (1.0 / field->cell);
    /* what is no number is at the border, too */
    return (beam)least(most(row, 0.0), (double)(field->rows - 1)) * field->columns +
           (beam)least(most(column, 0.0), (double)(field->columns - 1));
}

/* The number of the line in that cell; -1 with IndexError where the field has no such line. */
static beam line_in(const struct field *field, const struct row *lines, beam cell) {
    beam line = AT(npy_int32, *lines, cell);
    if (line >= 0 && line < field->normals.count)
        return line;
    PyErr_Format(PyExc_IndexError, "lay_on_lines: no line %zd", line);
    return -1;
}

static int lay(const struct field *field, const struct row *ends, const struct row *ahead, const double *pose,
               struct laid *to) {
    place turn = CMPLX(cos(pose[2]), sin(pose[2])), at = CMPLX(pose[0], pose[1]);
    for (beam i = 0; i < ends->count; i++) {
        place arm = times(PLACE(*ends, i), turn), toward = times(PLACE(*ahead, i), turn), end = arm + at;
        beam cell = cell_of(field, end), line = line_in(field, &field->near, cell);
        if (line < 0)
            return 0;
        place normal = PLACE(field->normals, line);
        if (creal(normal) * creal(toward) + cimag(normal) * cimag(toward) > 0.0) {
            if ((line = line_in(field, &field->far, cell)) < 0)
                return 0;
            normal = PLACE(field->normals, line);
        }
        double x = creal(normal), y = cimag(normal);
        to[i].end = end;
        to[i].off = creal(end) * x + cimag(end) * y - NUMBER(field->offsets, line);
        to[i].slope[0] = x;
        to[i].slope[1] = y;
        to[i].slope[2] = creal(arm) * y - cimag(arm) * x;
    }
    return 1;
}

struct pull {
    double information[9], pull[3], determined;
};

/* Leave out what is told of the direction (ux, uy) of the plane. */
static void leave_out(struct pull *told, double ux, double uy) {
    const double strong[9] = {uy * uy, -ux * uy, 0.0, -ux * uy, ux * ux, 0.0, 0.0, 0.0, 1.0};
    double half[9] = {0.0}, whole[9] = {0.0}, pull[3] = {0.0};
    for (int i = 0; i < 3; i++)
        for (int j = 0; j < 3; j++) {
            pull[i] += strong[3 * i + j] * told->pull[j];
            for (int k = 0; k < 3; k++)
                half[3 * i + j] += strong[3 * i + k] * told->information[3 * k + j];
        }
    for (int i = 0; i < 3; i++)
        for (int j = 0; j < 3; j++)
            for (int k = 0; k < 3; k++)
                whole[3 * i + j] += half[3 * i + k] * strong[3 * k + j];
    memcpy(told->information, whole, sizeof whole);
    memcpy(told->pull, pull, sizeof pull);
}

static struct pull pull_of(const struct laid *laid, beam many) {
    struct pull told = {{0.0}, {0.0}, 0.0};
    const double share = least(1.0, SCAN_ON_LINES_BEAMS_ALIKE / (double)(many > 1 ? many : 1));
    const double each = share / (SCAN_ON_LINES_BEAM_STD_M * SCAN_ON_LINES_BEAM_STD_M);
    for (beam i = 0; i < many; i++) {
        double spread = laid[i].off * laid[i].off / laid[i].kernel + 1.0, weight = each / (spread * spread);
        for (int k = 0; k < 3; k++) {
            double weighted = weight * laid[i].slope[k];
            told.pull[k] += weighted * laid[i].off;
            for (int j = k; j < 3; j++)
                told.information[3 * k + j] += weighted * laid[i].slope[j];
        }
    }
    for (int k = 1; k < 3; k++)
        for (int j = 0; j < k; j++)
            told.information[3 * k + j] = told.information[3 * j + k];
    double a = told.information[0], b = told.information[1], d = told.information[4];
    if (a + d <= 0.0)
        return (struct pull){{0.0}, {0.0}, 0.0};
    double weak = 0.5 * atan2(2.0 * b, a - d) + 0.5 * M_PI, ux = cos(weak), uy = sin(weak), along = 0.0;
    for (beam i = 0; i < many; i++) {
        double toward = ux * laid[i].slope[0] + uy * laid[i].slope[1];
        if (fabs(toward) > SCAN_ON_LINES_FACES) {
            double spread = laid[i].off * laid[i].off / laid[i].kernel + 1.0;
            along += each / (spread * spread) * toward * toward;
        }
    }
    told.determined = along / (0.5 * (a + d) + hypot(0.5 * (a - d), b));
    if (told.determined < SCAN_ON_LINES_WEAK_SHARE)
        leave_out(&told, ux, uy);
    return told;
}

/* By Cramer's rule. */
int solve_three(const double *m, const double *y, double *x) {
    double c0 = m[4] * m[8] - m[5] * m[7], c1 = m[5] * m[6] - m[3] * m[8], c2 = m[3] * m[7] - m[4] * m[6];
    double whole = m[0] * c0 + m[1] * c1 + m[2] * c2;
    x[0] = -(c0 * y[0] + (m[2] * m[7] - m[1] * m[8]) * y[1] + (m[1] * m[5] - m[2] * m[4]) * y[2]) / whole;
    x[1] = -(c1 * y[0] + (m[0] * m[8] - m[2] * m[6]) * y[1] + (m[2] * m[3] - m[0] * m[5]) * y[2]) / whole;
    x[2] = -(c2 * y[0] + (m[1] * m[6] - m[0] * m[7]) * y[1] + (m[0] * m[4] - m[1] * m[3]) * y[2]) / whole;
    if (whole)
        return 1;
    PyErr_SetString(PyExc_ValueError, "Singular matrix"); /* as numpy */
    return 0;
}

/* The steps: moved, and what the last one was told; laid at the end. */
static int stepped(const struct field *field, const struct row *ends, const struct row *ahead, const double *pose,
                   const double *prior, double *moved, struct pull *told, struct laid *laid) {
    for (beam step = 0; step < SCAN_ON_LINES_STEPS; step++) {
        double sum[9], toward[3], move[3], at[3];
        *told = pull_of(laid, ends->count);
        for (int i = 0; i < 3; i++) {
            toward[i] = told->pull[i];
            for (int j = 0; j < 3; j++) {
                sum[3 * i + j] = prior[3 * i + j] + told->information[3 * i + j];
                toward[i] += prior[3 * i + j] * moved[j];
            }
        }
        if (!solve_three(sum, toward, move))
            return 0;
        for (int i = 0; i < 3; i++)
            at[i] = pose[i] + (moved[i] += move[i]);
        if (!lay(field, ends, ahead, at, laid))
            return 0;
        if (fabs(move[0]) + fabs(move[1]) < SCAN_ON_LINES_ENOUGH_M && fabs(move[2]) < SCAN_ON_LINES_ENOUGH_RAD)
            break;
    }
    return 1;
}

static PyObject *laying(const struct field *field, const struct laid *laid, beam many, const double *moved,
                        const struct pull *told) {
    Py_ssize_t on_wall = 0, before = 0;
    for (beam i = 0; i < many; i++) {
        int fits = fabs(laid[i].off) < SCAN_ON_LINES_FITS_M;
        on_wall += fits;
        before += !fits && FLAG(field->free, cell_of(field, laid[i].end));
    }
    const double *m = told->information;
    return Py_BuildValue("((ddd)(ddddddddd)(nn)d)", moved[0], moved[1], moved[2], m[0], m[1], m[2], m[3], m[4], m[5], m[6],
                         m[7], m[8], on_wall, before, told->determined);
}

static int as_field(PyObject *const *given, struct field *field) {
    double corner[3];
    beam size[2];
    if (!as_row(given[0], NPY_INT32, &field->near) || !as_row(given[1], NPY_INT32, &field->far) ||
        !as_row(given[2], NPY_CDOUBLE, &field->normals) || !as_row(given[3], NPY_DOUBLE, &field->offsets) ||
        !as_row(given[4], NPY_BOOL, &field->free) || !as_numbers(given + 5, 3, corner) || !as_indices(given + 8, 2, size))
        return 0;
    const beam cells = field->near.count;
    int fits = size[0] > 0 && size[1] > 0 && size[0] <= cells / size[1] && field->far.count == cells &&
               field->free.count == cells && field->offsets.count == field->normals.count;
    if (!fits)
        PyErr_SetString(PyExc_ValueError, "lay_on_lines: arrays of different lengths");
    field->corner_x = corner[0], field->corner_y = corner[1], field->cell = corner[2];
    field->rows = size[0], field->columns = size[1];
    return fits;
}

/* lay_on_lines(places, ahead, alone, near, far, normals, offsets, free, corner x, corner y, cell, rows, columns, *pose,
 *     before, prior) -> moved, information, (on wall, before one), determined */
KERNEL(lay_on_lines) {
    struct row ends, ahead, alone;
    struct field field;
    double pose[3], before[9], prior[9], moved[3] = {0.0};
    if (!enough(count, 18, "lay_on_lines") || !as_row(given[0], NPY_CDOUBLE, &ends) ||
        !as_row(given[1], NPY_CDOUBLE, &ahead) || !as_row(given[2], NPY_BOOL, &alone) || !as_field(given + 3, &field) ||
        !as_numbers(given + 13, 3, pose) || !same_count(given[16], 9, before) || !same_count(given[17], 9, prior))
        return NULL;
    if (ahead.count != ends.count || alone.count != ends.count)
        return PyErr_Format(PyExc_ValueError, "lay_on_lines: arrays of different lengths");
    struct laid *laid = malloc(sizeof *laid * (size_t)(ends.count + 1));
    if (!laid)
        return PyErr_NoMemory();
    PyObject *answer = NULL;
    struct pull told = {{0.0}, {0.0}, 0.0};
    if (lay(&field, &ends, &ahead, pose, laid)) {
        for (beam i = 0; i < ends.count; i++) {
            const double *s = laid[i].slope;
            double doubt = 0.0;
            for (int k = 0; k < 3; k++)
                doubt += s[k] * (before[3 * k] * s[0] + before[3 * k + 1] * s[1] + before[3 * k + 2] * s[2]);
            laid[i].kernel = SCAN_ON_LINES_KERNEL_M * SCAN_ON_LINES_KERNEL_M + (FLAG(alone, i) ? 0.0 : 4.0 * doubt);
        }
        if (stepped(&field, &ends, &ahead, pose, prior, moved, &told, laid))
            answer = laying(&field, laid, ends.count, moved, &told);
    }
    free(laid);
    return answer;
}
