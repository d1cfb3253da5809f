// The commit that this program was built from.
#pragma once

namespace glasswing {

// "1a2b3c4d", with a "+" if files were changed since the commit; empty if unknown.
const char* build_id();

}  // namespace glasswing
