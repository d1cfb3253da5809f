// The photographs of a folder, in the order in which they were taken.
#pragma once

#include <absl/status/statusor.h>

#include <filesystem>
#include <string>
#include <vector>

namespace glasswing {

// Pictures (PNG, JPEG, TIFF, BMP, PGM, PPM) in `directory`, or, with a glob, those in it and the folders
// below it whose relative path matches (`*` fits `/` too). In natural order, numbers by value: 2.png
// before 10.png. If a camera's numbers wrapped, 9999 comes before 0001, which EXIF dates must confirm.
// NOT_FOUND: no picture. INVALID_ARGUMENT: more than kMaxPhotographs; or numbers wrapped, but dates do not
// confirm it.
inline constexpr size_t kMaxPhotographs = 512;
absl::StatusOr<std::vector<std::string>> photographs_in(const std::filesystem::path& directory,
                                                        const std::string& glob);

// Natural order: digits compare as numbers, everything else byte by byte.
bool natural_less(const std::string& a, const std::string& b);

}  // namespace glasswing
