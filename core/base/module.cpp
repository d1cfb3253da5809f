#include "core/base/module.h"

#include <dlfcn.h>
#include <fmt/format.h>
#include <link.h>

#include <filesystem>

namespace glasswing {
namespace {

namespace fs = std::filesystem;

// The file that holds this code: a program, or Python's module.
fs::path own_file() {
  Dl_info ignored{};
  link_map* map = nullptr;
  const void* here = reinterpret_cast<const void*>(&own_file);
  const bool found = ::dladdr1(here, &ignored, reinterpret_cast<void**>(&map), RTLD_DL_LINKMAP) != 0;
  std::error_code failed;
  return fs::canonical(found && *map->l_name != '\0' ? map->l_name : "/proc/self/exe", failed);
}

}  // namespace

absl::StatusOr<const void*> load_module(const std::string& file, const std::string& symbol) {
  const fs::path own = own_file(), below = fs::path("lib/glasswing") / file;
  std::error_code ignored;
  fs::path above = own.parent_path();
  while (above.has_relative_path() && !fs::exists(above / below, ignored)) above = above.parent_path();
  const auto missing = [&](const std::string& why) {
    return absl::UnimplementedError(fmt::format("{} cannot be used: {}", file, why));
  };
  if (!fs::exists(above / below, ignored))
    return missing(fmt::format("there is no {} above {}", below.string(), own.string()));
  void* module = ::dlopen((above / below).c_str(), RTLD_NOW | RTLD_LOCAL);
  const void* address = module == nullptr ? nullptr : ::dlsym(module, symbol.c_str());
  if (address == nullptr) return missing(::dlerror());
  return address;
}

}  // namespace glasswing
