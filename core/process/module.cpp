#include "core/process/module.h"

#include <dlfcn.h>
#include <fmt/format.h>
#include <link.h>

#include <filesystem>

#include "core/base/status.h"

namespace glasswing {
namespace {

namespace fs = std::filesystem;

// The file that contains this code: a program, or Python's module.
fs::path own_file() {
  Dl_info ignored{};
  link_map* map = nullptr;
  const void* here = reinterpret_cast<const void*>(&own_file);
  const bool found = ::dladdr1(here, &ignored, reinterpret_cast<void**>(&map), RTLD_DL_LINKMAP) != 0;
  std::error_code failed;
  return fs::canonical(found && *map->l_name != '\0' ? map->l_name : "/proc/self/exe", failed);
}

absl::Status missing(const std::string& file, const std::string& why) {
  return absl::UnimplementedError(fmt::format("{} cannot be used: {}", file, why));
}

absl::StatusOr<fs::path> find_above(const std::string& file, const fs::path& below) {
  const fs::path own = own_file();
  std::error_code ignored;
  fs::path above = own.parent_path();
  while (above.has_relative_path() && !fs::exists(above / below, ignored)) above = above.parent_path();
  if (fs::exists(above / below, ignored)) return above / below;
  return missing(file, fmt::format("there is no {} above {}", below.string(), own.string()));
}

}  // namespace

absl::StatusOr<fs::path> find_program(const std::string& name) {
  return find_above(name, fs::path("bin") / name);
}

absl::StatusOr<fs::path> find_module(const std::string& file) {
  return find_above(file, fs::path("lib/glasswing") / file);
}

absl::StatusOr<const void*> load_module(const std::string& file, const std::string& symbol) {
  GW_ASSIGN_OR_RETURN(const fs::path path, find_module(file));
  void* module = ::dlopen(path.c_str(), RTLD_NOW | RTLD_LOCAL);
  const void* address = module == nullptr ? nullptr : ::dlsym(module, symbol.c_str());
  if (address == nullptr) return missing(file, ::dlerror());
  return address;
}

}  // namespace glasswing
