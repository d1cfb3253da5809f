#include "client/layouts/photograph_files.h"

#include <fmt/format.h>
#include <fnmatch.h>

#include <algorithm>
#include <array>
#include <charconv>
#include <cstdint>
#include <optional>
#include <string_view>

#include "core/base/status.h"
#include "core/file/file.h"
#include "core/image/image_file.h"
#include "core/image/raw_photograph.h"

namespace glasswing {
namespace {

namespace fs = std::filesystem;

bool is_digit(char c) {
  return c >= '0' && c <= '9';
}

// The digits from `at` on, without leading zeros; moves `at` behind them.
std::string_view number_at(const std::string& text, size_t& at) {
  while (at < text.size() && text[at] == '0') ++at;
  const size_t start = at;
  while (at < text.size() && is_digit(text[at])) ++at;
  return std::string_view(text).substr(start, at - start);
}

// Names that begin with a dot are not pictures: macOS puts ._NAME beside each file on other systems' disks.
bool is_picture(const fs::path& file) {
  if (file.filename().string().starts_with('.')) return false;
  constexpr std::array<std::string_view, 8> kSuffixes{".png",  ".jpg", ".jpeg", ".tif",
                                                      ".tiff", ".bmp", ".pgm",  ".ppm"};
  std::string suffix = file.extension().string();
  for (char& c : suffix) c = c >= 'A' && c <= 'Z' ? static_cast<char>(c - 'A' + 'a') : c;
  return std::ranges::find(kSuffixes, suffix) != kSuffixes.end() || is_raw_file(file);
}

// The last number of a file's name; none: it has no number, or one that is too large.
std::optional<std::int64_t> last_number(const std::string& file) {
  const std::string name = fs::path(file).stem().string();
  const size_t end = name.find_last_of("0123456789");
  if (end == std::string::npos) return std::nullopt;
  const size_t before = name.find_last_not_of("0123456789", end);
  const size_t begin = before == std::string::npos ? 0 : before + 1;
  std::int64_t number = 0;
  const auto [stop, error] = std::from_chars(name.data() + begin, name.data() + end + 1, number);
  return error == std::errc() ? std::optional(number) : std::nullopt;
}

// Where the numbers of sorted names begin if they wrapped: after the only gap, while 9999 (or 999, ...) and 0
// or 1 are both there. 0: they did not wrap.
size_t begin_of(const std::vector<std::string>& files) {
  std::vector<std::int64_t> numbers;
  for (const std::string& file : files) {
    const std::optional<std::int64_t> number = last_number(file);
    if (!number || (!numbers.empty() && *number <= numbers.back())) return 0;
    numbers.push_back(*number);
  }
  std::int64_t highest = 999;
  while (highest < numbers.back()) highest = 10 * highest + 9;
  if (numbers.front() > 1 || numbers.back() != highest) return 0;
  size_t begin = 0;
  for (size_t i = 1; i < numbers.size(); ++i) {
    if (numbers[i] == numbers[i - 1] + 1) continue;
    if (begin > 0) return 0;
    begin = i;
  }
  return begin;
}

// Puts sorted names whose numbers wrapped into the order of their dates.
absl::Status unwrap(const fs::path& directory, std::vector<std::string>& files) {
  const size_t begin = begin_of(files);
  if (begin == 0) return absl::OkStatus();
  const std::string last = files.back(), first = files.front();
  std::rotate(files.begin(), files.begin() + begin, files.end());
  std::vector<std::string> dates;
  for (const std::string& file : files) {
    GW_ASSIGN_OR_RETURN(const std::string bytes, read_file(directory / file));
    dates.push_back(date_taken(bytes));
  }
  if (!dates.front().empty() && dates.front() != dates.back() && std::ranges::is_sorted(dates))
    return absl::OkStatus();
  return absl::InvalidArgumentError(
      fmt::format("the numbers of {} and {} seem to belong to one series that wrapped, but the files contain "
                  "no dates to confirm it; rename them in order",
                  (directory / last).string(), (directory / first).string()));
}

}  // namespace

bool natural_less(const std::string& a, const std::string& b) {
  size_t i = 0, j = 0;
  while (i < a.size() && j < b.size()) {
    if (is_digit(a[i]) && is_digit(b[j])) {
      const std::string_view one = number_at(a, i), other = number_at(b, j);
      if (one.size() != other.size()) return one.size() < other.size();
      if (one != other) return one < other;
    } else {
      if (a[i] != b[j]) return static_cast<unsigned char>(a[i]) < static_cast<unsigned char>(b[j]);
      ++i;
      ++j;
    }
  }
  if (a.size() - i != b.size() - j) return a.size() - i < b.size() - j;
  return a < b;  // the same but for leading zeros
}

absl::StatusOr<std::vector<std::string>> photographs_in(const fs::path& directory, const std::string& glob) {
  std::vector<std::string> files;
  std::error_code error;
  fs::recursive_directory_iterator entry(directory, error), end;
  for (; !error && entry != end; entry.increment(error)) {
    if (glob.empty()) entry.disable_recursion_pending();
    if (!entry->is_regular_file(error) || !is_picture(entry->path())) continue;
    const std::string file = entry->path().lexically_relative(directory).string();
    if (!glob.empty() && ::fnmatch(glob.c_str(), file.c_str(), FNM_PERIOD) != 0) continue;
    files.push_back(file);
    if (files.size() > kMaxPhotographs) {
      return absl::InvalidArgumentError(
          fmt::format("{} contains more than {} photographs; select some of them with --files",
                      directory.string(), kMaxPhotographs));
    }
  }
  if (error)
    return absl::NotFoundError(fmt::format("{} cannot be read: {}", directory.string(), error.message()));
  if (files.empty()) {
    return absl::NotFoundError(fmt::format("{} holds no PNG, JPEG, TIFF, BMP, PGM or PPM{}",
                                           directory.string(),
                                           glob.empty() ? "" : fmt::format(" that fits --files {}", glob)));
  }
  std::ranges::sort(files, natural_less);
  GW_RETURN_IF_ERROR(unwrap(directory, files));
  return files;
}

}  // namespace glasswing
