// The vector instructions that the kernels use on this machine. Results agree to the last bit only between
// solvers with the same target.
#pragma once

#include <string>

namespace glasswing {

// Such as "AVX2".
std::string vector_target();

}  // namespace glasswing
