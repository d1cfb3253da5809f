// What this program was built of.
#pragma once

namespace glasswing {

// The commit, "1a2b3c4d", with a "+" if files were changed since; empty where that is not known.
const char* build_id();

}  // namespace glasswing
