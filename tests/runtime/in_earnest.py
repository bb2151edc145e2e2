"""A judgement in earnest: as the mux judges and commits."""


def judged(assessment, speed_mps, steering_rad):
    """Return the verdict on a command that is sent; what it leaves in the law's memory is committed."""
    verdict, memory = assessment.judge(speed_mps, steering_rad, assessment.memory)
    assessment.commit(memory)
    return verdict
