#include "core/import/sequences.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <array>
#include <string_view>

#include "core/base/status.h"
#include "core/frame/archive.h"
#include "core/import/foreign_manifest.h"

namespace glasswing {
namespace {

namespace fs = std::filesystem;
constexpr std::string_view kShown = "ramp";  // the stimulus of a video
constexpr const char* kBackgrounds = "bg";

bool is_digit(char c) {
  return c >= '0' && c <= '9';
}

// A file's name without suffix and number, and the digits of the number.
struct Stem {
  std::string name, digits;
};
Stem stem_of(const fs::path& file) {
  Stem stem{.name = file.stem().string(), .digits = ""};
  const auto last = std::find_if_not(stem.name.rbegin(), stem.name.rend(), is_digit).base();
  stem.digits.assign(last, stem.name.end());
  stem.name.erase(last, stem.name.end());
  return stem;
}

bool comes_before(const fs::path& a, const fs::path& b) {
  Stem one = stem_of(a), other = stem_of(b);
  for (Stem* stem : {&one, &other})
    stem->digits.erase(0, std::min(stem->digits.find_first_not_of('0'), stem->digits.size()));
  if (one.digits.size() != other.digits.size()) return one.digits.size() < other.digits.size();
  return one.digits != other.digits ? one.digits < other.digits : a < b;
}

std::vector<fs::path> pictures(const fs::path& directory) {
  constexpr std::array<std::string_view, 5> kSuffixes{".png", ".jpg", ".jpeg", ".tif", ".tiff"};
  std::vector<fs::path> files;
  std::error_code ignored;
  for (const fs::directory_entry& entry : fs::directory_iterator(directory, ignored)) {
    if (entry.is_regular_file(ignored) && !entry.path().filename().string().starts_with('.') &&
        std::ranges::find(kSuffixes, entry.path().extension().string()) != kSuffixes.end())
      files.push_back(entry.path());
  }
  std::ranges::sort(files, comes_before);
  return files;
}

std::vector<std::string> words_of(const std::string& name) {
  std::vector<std::string> words(1);
  for (const char c : name) {
    if (c == '_') {
      words.emplace_back();
    } else {
      words.back() += c;
    }
  }
  return words;
}

std::vector<std::string> sequences_in(const fs::path& directory) {
  std::vector<std::string> names;
  std::error_code ignored;
  for (const fs::directory_entry& entry : fs::directory_iterator(directory, ignored)) {
    const std::string name = entry.path().filename().string();
    if (name != kBackgrounds && words_of(name).front() == kShown && !numbered_pictures(entry.path()).empty())
      names.push_back(name);
  }
  std::ranges::sort(names);
  return names;
}

std::vector<fs::path> backgrounds_of(const fs::path& directory, const std::string& sequence) {
  const std::vector<std::string> words = words_of(sequence);
  const std::vector<fs::path> all = pictures(directory / kBackgrounds);
  for (size_t first = 1; first <= words.size(); ++first) {
    std::string name = words.front();
    for (size_t i = first; i < words.size(); ++i) name += "_" + words[i];
    std::vector<fs::path> found;
    std::ranges::copy_if(all, std::back_inserter(found),
                         [&](const fs::path& file) { return stem_of(file).name == name; });
    if (!found.empty()) return found;
  }
  return {};
}

}  // namespace

std::vector<fs::path> numbered_pictures(const fs::path& directory) {
  std::vector<fs::path> files = pictures(directory);
  std::erase_if(files, [](const fs::path& file) { return stem_of(file).digits.empty(); });
  return files;
}

std::int64_t missing_numbers(const std::vector<fs::path>& numbered) {
  if (numbered.empty()) return 0;
  const std::string first = stem_of(numbered.front()).digits, last = stem_of(numbered.back()).digits;
  constexpr size_t kMaxDigits = 15;
  if (first.size() > kMaxDigits || last.size() > kMaxDigits) return 0;
  const std::int64_t count = std::stoll(last) - std::stoll(first) + 1;
  return std::max<std::int64_t>(count - static_cast<std::int64_t>(numbered.size()), 0);
}

absl::StatusOr<v1::CaptureManifest> read_sequence(const fs::path& directory, const std::string& name) {
  GW_ASSIGN_OR_RETURN(v1::CaptureManifest manifest, read_sequences_header(directory));
  const std::vector<std::string> names = sequences_in(directory);
  if (std::ranges::find(names, name) == names.end()) {
    return absl::NotFoundError(
        fmt::format("{} has no sequence \"{}\" of the {}; it has: {}", directory.string(), name, kShown,
                    names.empty() ? "none" : fmt::format("{}", fmt::join(names, ", "))));
  }
  if (manifest.monitors_size() != 1) {
    return absl::InvalidArgumentError(fmt::format("{} names {} monitors; a video has one",
                                                  (directory / "manifest.json").string(),
                                                  manifest.monitors_size()));
  }
  const std::vector<fs::path> empty = backgrounds_of(directory, name);
  if (empty.empty()) {
    return absl::NotFoundError(
        fmt::format("{} has no picture of the empty stage for {}; it must be {}/{}.png", directory.string(),
                    name, kBackgrounds, kShown));
  }
  const auto add = [&](const std::vector<fs::path>& files, bool object) {
    for (const fs::path& file : files) {
      v1::Frame& frame = *manifest.add_frames();
      frame.set_file((file.parent_path().filename() / file.filename()).string());
      frame.set_object(object);
      frame.set_step(-1);
      frame.set_proof(v1::PROOF_IMPORTED);
      frame.mutable_stimulus()->set_kind(std::string(kShown));
      frame.mutable_stimulus()->set_panel(manifest.monitors(0).name());
    }
  };
  add(empty, false);
  add(numbered_pictures(directory / name), true);
  GW_RETURN_IF_ERROR(check_manifest(manifest));
  return manifest;
}

}  // namespace glasswing
