// Which of the processor's vectors the kernels use here: results agree to the last bit only between solvers
// with the same.
#pragma once

#include <string>

namespace glasswing {

// "AVX2"
std::string vector_target();

}  // namespace glasswing
