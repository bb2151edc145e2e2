/* Numpy arrays in C. Every function of the kernel returns the result of the Python function of the same name
 * (drivers/accelerated.py), which documents its meaning. Units: metres, radians. NaN is a beam without a distance, and every
 * comparison is written so that NaN falls on the side on which it falls in the Python.
 */

#ifndef WALLRIDE_ARRAYS_H
#define WALLRIDE_ARRAYS_H

#define PY_SSIZE_T_CLEAN
#include <Python.h>

#define NPY_NO_DEPRECATED_API NPY_2_0_API_VERSION
#define PY_ARRAY_UNIQUE_SYMBOL wallride_kernel_arrays
#ifndef KERNEL_MODULE
#define NO_IMPORT_ARRAY
#endif
#include <numpy/arrayobject.h>

#include <complex.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

/* Python's constants (constants.h), set once, before the first call. To the functions they are const, so that a loop
 * reads each one once. */
#ifndef KERNEL_MODULE
extern const double kernel_reals[];
extern const long kernel_wholes[];
#endif

typedef double complex place;
typedef Py_ssize_t beam;

/* One dimension of an array: its first element, the stride in bytes, the number of elements. */
struct row {
    char *data;
    npy_intp stride;
    beam count;
};

#define AT(type, row, i) (*(type *)((row).data + (i) * (row).stride))
#define NUMBER(row, i) AT(double, row, i)
#define FLAG(row, i) AT(npy_bool, row, i)
#define PLACE(row, i) AT(place, row, i)
#define INDEX(row, i) AT(npy_intp, row, i)

/* Read arguments; on a wrong one they set TypeError and return false. */
int as_row(PyObject *object, int type, struct row *row);
int as_numbers(PyObject *const *from, int count, double *to);
int as_indices(PyObject *const *from, int count, beam *to);
int numbers_of(PyObject *tuple, double *to); /* at most MAX_NUMBERS; how many, or -1 */
int same_count(PyObject *tuple, int count, double *to);
int flags_of(PyObject *tuple, int count, npy_bool *to);
#define MAX_NUMBERS 32
int enough(Py_ssize_t given, Py_ssize_t wanted, const char *name);

/* Fresh arrays; the data of an array that is known to be contiguous. */
PyObject *fresh(int type, beam count);
PyObject *copied(int type, beam count, const void *from);
#define DATA(type, array) ((type *)PyArray_DATA((PyArrayObject *)(array)))

#define TURNED_BACK(offset, heading) ((offset) * conj(heading))

/* Multiplying complex numbers by hand: C's own way looks for infinities. */
static inline place times(place a, place b) {
    return CMPLX(creal(a) * creal(b) - cimag(a) * cimag(b), creal(a) * cimag(b) + cimag(a) * creal(b));
}

static inline double least(double a, double b) { return a < b ? a : b; }
static inline double most(double a, double b) { return a > b ? a : b; }
static inline double within(double value, double from, double to) { return least(most(value, from), to); }

/* As Python's min and max: NaN stays NaN, and no command follows from it. */
static inline double lesser(double a, double b) { return b < a ? b : a; }
static inline double greater(double a, double b) { return b > a ? b : a; }
static inline double bounded(double value, double from, double to) { return lesser(greater(value, from), to); }

#define KERNEL(name) PyObject *name(PyObject *Py_UNUSED(self), PyObject *const *given, Py_ssize_t count)
KERNEL(decode_samples);
KERNEL(join_rows);
KERNEL(split_scan);
KERNEL(usable_ranges);
KERNEL(view_scan);
KERNEL(find_small_clusters);
KERNEL(find_thin_places);
KERNEL(find_returning);
KERNEL(solid_places);
KERNEL(any_nearer);
KERNEL(find_dark_regions);
KERNEL(sweep_arc);
KERNEL(roll_out_all);
KERNEL(fit_wall_line);
KERNEL(find_followed_wall);
KERNEL(roll_ball);
KERNEL(learn_noise_m);
KERNEL(drive_along_ball);
KERNEL(predict_motion);
KERNEL(dead_reckon);
KERNEL(predict_wall);
KERNEL(correct_wall);
KERNEL(weigh_dirt);
KERNEL(find_dirt);
KERNEL(find_near_places);
KERNEL(places_behind);
KERNEL(seen_again);
KERNEL(expected_m);
KERNEL(watch_sectors);
KERNEL(lay_on_lines);
KERNEL(ends_of_beams);
KERNEL(beside_path_m);
KERNEL(sweep_path);
KERNEL(slide_room_m);
KERNEL(drive_promise);
KERNEL(first_hidden);
KERNEL(mean_nearness);
KERNEL(free_beside_m);
KERNEL(match_scan);
KERNEL(lay_over);
KERNEL(over);
KERNEL(set_constant);
KERNEL(cast_cells);
KERNEL(cast_walls);

#endif
