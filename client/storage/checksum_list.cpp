#include "client/storage/checksum_list.h"

#include <absl/status/statusor.h>
#include <absl/strings/escaping.h>
#include <absl/strings/str_split.h>
#include <fmt/format.h>
#include <openssl/evp.h>

#include <array>
#include <map>
#include <memory>
#include <string>
#include <vector>

#include "core/base/status.h"
#include "core/cli/progress.h"
#include "core/file/file.h"
#include "core/file/positioned_file.h"

namespace glasswing {
namespace {

namespace fs = std::filesystem;

constexpr size_t kPieceBytes = 1 << 20, kDigits = 64;
constexpr std::uint64_t kMaxListBytes = 64 << 20;

absl::StatusOr<std::string> sha256_of(const fs::path& path) {
  GW_ASSIGN_OR_RETURN(const PositionedFile file, PositionedFile::open(path));
  GW_ASSIGN_OR_RETURN(const std::uint64_t size, file.size_bytes());
  const std::unique_ptr<EVP_MD_CTX, decltype(&EVP_MD_CTX_free)> context(EVP_MD_CTX_new(), EVP_MD_CTX_free);
  bool good = EVP_DigestInit_ex(context.get(), EVP_sha256(), nullptr) > 0;
  std::string piece;
  for (std::uint64_t at = 0; good && at < size; at += piece.size()) {
    piece.resize(std::min<std::uint64_t>(kPieceBytes, size - at));
    GW_RETURN_IF_ERROR(file.read_at(at, piece));
    good = EVP_DigestUpdate(context.get(), piece.data(), piece.size()) > 0;
  }
  std::array<unsigned char, EVP_MAX_MD_SIZE> digest{};
  unsigned length = 0;
  good = good && EVP_DigestFinal_ex(context.get(), digest.data(), &length) > 0;
  if (!good) return absl::InternalError("OpenSSL cannot compute SHA-256");
  return absl::BytesToHexString({reinterpret_cast<const char*>(digest.data()), length});
}

// The files below the directory, without the list itself.
absl::StatusOr<std::map<std::string, fs::path>> files_of(const fs::path& directory) {
  std::map<std::string, fs::path> files;
  std::error_code error;
  for (fs::recursive_directory_iterator entry(directory, error), end; !error && entry != end;
       entry.increment(error)) {
    const std::string name = entry->path().lexically_relative(directory).generic_string();
    if (!entry->is_directory() && name != kChecksumList) files[name] = entry->path();
  }
  if (error) return absl::ErrnoToStatus(error.value(), fmt::format("cannot read {}", directory.string()));
  return files;
}

// By file.
absl::StatusOr<std::map<std::string, std::string>> read_list(const fs::path& path) {
  std::error_code error;
  if (fs::file_size(path, error) > kMaxListBytes && !error)
    return absl::DataLossError(fmt::format("{} is larger than any list of checksums", path.string()));
  GW_ASSIGN_OR_RETURN(const std::string text, read_file(path));
  std::map<std::string, std::string> list;
  for (const std::string& line : std::vector<std::string>(absl::StrSplit(text, '\n', absl::SkipEmpty()))) {
    const bool good = line.size() > kDigits + 2 && line.substr(kDigits, 2) == "  " &&
                      line.find_first_not_of("0123456789abcdef") == kDigits;
    if (!good) return absl::DataLossError(fmt::format("{} is damaged: \"{}\"", path.string(), line));
    list[line.substr(kDigits + 2)] = line.substr(0, kDigits);
  }
  return list;
}

}  // namespace

absl::Status write_checksum_list(const fs::path& directory) {
  GW_ASSIGN_OR_RETURN(const auto files, files_of(directory));
  std::string list;
  for (const auto& [name, path] : files) {
    GW_ASSIGN_OR_RETURN(const std::string sum, sha256_of(path));
    list += fmt::format("{}  {}\n", sum, name);
  }
  return write_file_durably(directory / kChecksumList, list);
}

absl::Status check_checksum_list(const fs::path& directory, const std::string& title) {
  const fs::path path = directory / kChecksumList;
  std::error_code ignored;
  if (!fs::exists(path, ignored)) {
    return absl::NotFoundError(fmt::format(
        "{} has no {}: it is no archive that glasswing archive wrote, or it is incomplete; frames without a "
        "list of checksums are taken by glasswing import",
        title, kChecksumList));
  }
  GW_ASSIGN_OR_RETURN(auto list, read_list(path));
  GW_ASSIGN_OR_RETURN(const auto files, files_of(directory));
  Progress progress("checking");
  size_t done = 0;
  for (const auto& [name, file] : files) {
    const auto listed = list.find(name);
    if (listed == list.end())
      return absl::DataLossError(fmt::format("{}/{} is not in {}", title, name, kChecksumList));
    GW_ASSIGN_OR_RETURN(const std::string sum, sha256_of(file));
    if (sum != listed->second) {
      return absl::DataLossError(fmt::format("{}/{} is damaged: its SHA-256 is {}, {} says {}", title, name,
                                             sum, kChecksumList, listed->second));
    }
    list.erase(listed);
    progress.update(static_cast<double>(++done) / static_cast<double>(files.size()));
  }
  if (list.empty()) return absl::OkStatus();
  return absl::DataLossError(fmt::format("{}/{} is missing", title, list.begin()->first));
}

}  // namespace glasswing
