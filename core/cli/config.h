// A program's settings. Each is taken from its option, the environment, the configuration file, or the
// default, in this order.
#pragma once

#include <absl/status/status.h>

#include <CLI/CLI.hpp>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

namespace glasswing {

struct Setting {
  std::string key;               // name in the file; the option is --key
  std::string environment = {};  // variable; empty: none
  std::string value = {};
  std::string type = {};  // "FILE": a path, relative to the configuration file if given there
  std::string help = {};
  std::string from = "default";           // where the value came from: "option", the variable, or the file
  std::optional<std::string> given = {};  // the option's value
};

class Config {
 public:
  // Adds --config and the options of `settings` and of "color".
  Config(CLI::App& app, std::vector<Setting> settings);
  Config(const Config&) = delete;
  Config& operator=(const Config&) = delete;

  // Call after parsing the command line. INVALID_ARGUMENT names the file and the wrong line or key.
  // NOT_FOUND: the file named by --config or the environment does not exist (the usual one may be missing).
  absl::Status resolve();

  const std::string& operator[](const std::string& key) const;
  const std::vector<Setting>& settings() const { return settings_; }
  const std::filesystem::path& file() const { return file_; }
  bool file_is_there() const { return file_is_there_; }

 private:
  absl::Status read(const std::filesystem::path& path);

  std::vector<Setting> settings_;
  std::string file_option_;
  std::filesystem::path file_;
  bool file_is_there_ = false;
};

}  // namespace glasswing
