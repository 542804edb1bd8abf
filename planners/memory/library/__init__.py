"""Plans of any questions, in any frames, whose parts answer other questions."""
