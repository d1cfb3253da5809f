// The client's own settings: each is an option's, else the environment's, else the configuration file's, else
// the default.
#pragma once

#include <absl/status/status.h>

#include <CLI/CLI.hpp>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

namespace glasswing {

struct Setting {
  std::string key;          // in the file; the option is --key
  std::string environment;  // the variable; empty: none
  std::string value;
  bool is_file = false;                   // in the configuration file it is relative to that one's directory
  std::string from = "default";           // "option", the variable, or the file
  std::optional<std::string> given = {};  // by the option
};

class Config {
 public:
  // Declares the options of all settings, and --config.
  explicit Config(CLI::App& app);
  Config(const Config&) = delete;
  Config& operator=(const Config&) = delete;

  // Once the command line is parsed. INVALID_ARGUMENT names the file, and the line or key, that is wrong;
  // NOT_FOUND: a file that was asked for is not there (the usual one need not be).
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
