"""A judgement in earnest, as the mux judges and commits; and when two answers are the same."""


def judged(assessment, speed_mps, steering_rad):
    """Return the verdict on a command that is sent; what it leaves in the law's memory is committed."""
    verdict, memory = assessment.judge(speed_mps, steering_rad, assessment.memory)
    assessment.commit(memory)
    return verdict


def is_same(one, other):
    """Tell whether two values have the same fields; two NaN are the same, which `==` of 3.13 denies."""
    return repr(one) == repr(other)
