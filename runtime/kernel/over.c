/* A function of the kernel behind the Python function that makes its arguments: one call for the caller, without the
 * frame of a Python function between the two.
 */

#include "arrays.h"

#include <stddef.h>

struct over {
    PyObject_HEAD vectorcallfunc call;
    PyObject *function, *flat;
};

static PyObject *answer(PyObject *self, PyObject *const *given, size_t flagged, PyObject *names) {
    const struct over *both = (const struct over *)self;
    if (names != NULL && PyTuple_GET_SIZE(names)) {
        PyErr_SetString(PyExc_TypeError, "an accelerated function takes its arguments by position only");
        return NULL;
    }
    PyObject *flat = PyObject_Vectorcall(both->flat, given, (size_t)PyVectorcall_NARGS(flagged), NULL);
    if (flat == NULL)
        return NULL;
    PyObject *result = NULL;
    if (PyTuple_Check(flat))
        result = PyObject_Vectorcall(both->function, ((PyTupleObject *)flat)->ob_item, (size_t)PyTuple_GET_SIZE(flat),
                                     NULL);
    else
        PyErr_Format(PyExc_TypeError, "%R made %R, not a tuple of arguments", both->flat, flat);
    Py_DECREF(flat);
    return result;
}

static void forget(PyObject *self) {
    struct over *both = (struct over *)self;
    Py_XDECREF(both->function);
    Py_XDECREF(both->flat);
    Py_TYPE(self)->tp_free(self);
}

static PyTypeObject over_type = {
    PyVarObject_HEAD_INIT(NULL, 0).tp_name = "wallride.drivers._accelerated.Over",
    .tp_basicsize = sizeof(struct over),
    .tp_dealloc = forget,
    .tp_vectorcall_offset = offsetof(struct over, call),
    .tp_call = PyVectorcall_Call,
    .tp_flags = Py_TPFLAGS_DEFAULT | Py_TPFLAGS_HAVE_VECTORCALL,
};

/* over(function, flat): a callable that answers flat's arguments with function(*flat(*arguments)). */
KERNEL(over) {
    if (!enough(count, 2, "over") || PyType_Ready(&over_type) < 0)
        return NULL;
    struct over *both = PyObject_New(struct over, &over_type);
    if (both == NULL)
        return NULL;
    both->call = answer;
    both->function = Py_NewRef(given[0]);
    both->flat = Py_NewRef(given[1]);
    return (PyObject *)both;
}
