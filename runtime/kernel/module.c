/* The module `wallride.drivers._accelerated`: its functions, and how they read their arguments. Only constants are kept between
 * calls. */

#define KERNEL_MODULE
#include "arrays.h"
#include "constants.h"
#include "seal.h"

double kernel_reals[CONSTANTS];
long kernel_wholes[CONSTANTS];

int as_row(PyObject *object, int type, struct row *row) {
    if (!PyArray_Check(object) || PyArray_NDIM((PyArrayObject *)object) != 1 ||
        PyArray_TYPE((PyArrayObject *)object) != type || !PyArray_ISBEHAVED_RO((PyArrayObject *)object)) {
        PyErr_Format(PyExc_TypeError, "the kernel wants a one-dimensional array of type %d, not %R", type, object);
        return 0;
    }
    row->data = PyArray_BYTES((PyArrayObject *)object);
    row->stride = PyArray_STRIDE((PyArrayObject *)object, 0);
    row->count = PyArray_DIM((PyArrayObject *)object, 0);
    return 1;
}

int as_numbers(PyObject *const *from, int count, double *to) {
    for (int i = 0; i < count; i++) {
        to[i] = PyFloat_AsDouble(from[i]);
        if (to[i] == -1.0 && PyErr_Occurred())
            return 0;
    }
    return 1;
}

int as_indices(PyObject *const *from, int count, beam *to) {
    for (int i = 0; i < count; i++) {
        to[i] = PyNumber_AsSsize_t(from[i], PyExc_OverflowError);
        if (to[i] == -1 && PyErr_Occurred())
            return 0;
    }
    return 1;
}

int numbers_of(PyObject *tuple, double *to) {
    if (!PyTuple_Check(tuple) || PyTuple_GET_SIZE(tuple) > MAX_NUMBERS) {
        PyErr_Format(PyExc_TypeError, "the kernel wants a tuple of at most %d numbers", MAX_NUMBERS);
        return -1;
    }
    int count = (int)PyTuple_GET_SIZE(tuple);
    for (int i = 0; i < count; i++) {
        PyObject *one = PyTuple_GET_ITEM(tuple, i);
        if (!as_numbers(&one, 1, to + i))
            return -1;
    }
    return count;
}

int same_count(PyObject *tuple, int count, double *to) {
    if (PyTuple_Check(tuple) && PyTuple_GET_SIZE(tuple) == count) /* first: there is no room for more */
        return numbers_of(tuple, to) == count;
    PyErr_Format(PyExc_TypeError, "the kernel wants a tuple of %d numbers, not %R", count, tuple);
    return 0;
}

int flags_of(PyObject *tuple, int count, npy_bool *to) {
    double numbers[MAX_NUMBERS];
    if (!same_count(tuple, count, numbers))
        return 0;
    for (int i = 0; i < count; i++)
        to[i] = numbers[i] != 0.0;
    return 1;
}

int enough(Py_ssize_t given, Py_ssize_t wanted, const char *name) {
    if (given == wanted)
        return 1;
    PyErr_Format(PyExc_TypeError, "%s takes %zd arguments, not %zd", name, wanted, given);
    return 0;
}

PyObject *fresh(int type, beam count) {
    npy_intp shape = count;
    return PyArray_SimpleNew(1, &shape, type);
}

PyObject *copied(int type, beam count, const void *from) {
    PyObject *array = fresh(type, count);
    if (array != NULL && count)
        memcpy(DATA(char, array), from, (size_t)count * (size_t)PyArray_ITEMSIZE((PyArrayObject *)array));
    return array;
}

#define ENTRY(name) {#name, (PyCFunction)(void (*)(void))name, METH_FASTCALL, NULL}
static PyMethodDef functions[] = {
    ENTRY(decode_samples), ENTRY(join_rows), ENTRY(view_scan), ENTRY(find_small_clusters), ENTRY(find_thin_places),
    ENTRY(find_returning), ENTRY(solid_places), ENTRY(any_nearer), ENTRY(find_dark_regions), ENTRY(sweep_arc),
    ENTRY(fit_wall_line), ENTRY(find_followed_wall), ENTRY(roll_ball), ENTRY(drive_along_ball), ENTRY(split_scan),
    ENTRY(predict_motion), ENTRY(predict_wall), ENTRY(correct_wall), ENTRY(dead_reckon), ENTRY(weigh_dirt),
    ENTRY(find_dirt), ENTRY(find_near_places), ENTRY(watch_sectors), ENTRY(roll_out_all), ENTRY(places_behind),
    ENTRY(learn_noise_m), ENTRY(lay_on_lines), ENTRY(beside_path_m), ENTRY(sweep_path), ENTRY(slide_room_m),
    ENTRY(mean_nearness), ENTRY(free_beside_m), ENTRY(match_scan), ENTRY(seen_again), ENTRY(expected_m), ENTRY(over),
    ENTRY(set_constant), ENTRY(lay_over), ENTRY(ends_of_beams), ENTRY(drive_promise), ENTRY(first_hidden),
    ENTRY(usable_ranges), ENTRY(cast_cells), ENTRY(cast_walls),
    {NULL, NULL, 0, NULL},
};

/* set_constant(slot, value): the number of Python that is at this slot of constants.h, before the first call. */
KERNEL(set_constant) {
    beam slot;
    double value;
    if (!enough(count, 2, "set_constant") || !as_indices(given, 1, &slot) || !as_numbers(given + 1, 1, &value))
        return NULL;
    if (slot < 0 || slot >= CONSTANTS)
        return PyErr_Format(PyExc_IndexError, "set_constant: no slot %zd", slot);
    kernel_reals[slot] = value;
    if (PyLong_Check(given[1])) {
        kernel_wholes[slot] = PyLong_AsLong(given[1]);
        if (kernel_wholes[slot] == -1 && PyErr_Occurred())
            return NULL;
    }
    Py_RETURN_NONE;
}

static struct PyModuleDef definition = {
    PyModuleDef_HEAD_INIT, "_accelerated", NULL, -1, functions, NULL, NULL, NULL, NULL,
};

PyMODINIT_FUNC PyInit__accelerated(void) {
    import_array();
    for (int slot = 0; slot < CONSTANTS; slot++)
        kernel_reals[slot] = NAN; /* until Python has handed it over */
    PyObject *module = PyModule_Create(&definition);
    if (module && PyModule_AddStringConstant(module, "SEAL", SEAL) < 0)
        Py_CLEAR(module);
    return module;
}
