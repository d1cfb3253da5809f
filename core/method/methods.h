// The table of methods: servers check requests against it, solvers read values from it, and command line,
// console and docs show it. solver/methods.cpp makes them.
#pragma once

#include <absl/status/status.h>
#include <absl/status/statusor.h>

#include <map>
#include <span>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

namespace glasswing {

// An option has a number in [low, high], or one of `choices`.
struct MethodOption {
  std::string_view name;
  std::string_view usual;  // the default: a value, or words where it depends on the frames ("all")
  std::string_view help;   // one line of text
  double low = 0.0, high = 0.0;
  bool whole = false;                               // takes whole numbers only
  std::vector<std::string_view> choices = {};       // empty: a number
  std::string_view only_with = std::string_view();  // refused without this setting: "backings=1"
};

struct SolvingMethod {
  std::string_view name;
  // Raised whenever a change of the code gives different numbers for the same frames: tiles of two versions
  // must not be in one matte.
  int version = 1;
  // An archive that names no method is solved by the one with the lowest rank among those whose stimuli
  // (stimulus.proto: kind) it shows.
  std::string_view stimulus;
  int rank = 0;
  std::vector<MethodOption> options;
};

inline constexpr std::string_view kRampMethod = "ramp";  // solves videos frame by frame

std::span<const SolvingMethod> solving_methods();
std::vector<std::string> method_names();
// INVALID_ARGUMENT lists the names.
absl::Status check_method(std::string_view name);
// Empty: there is no such method.
std::span<const MethodOption> options_of(std::string_view method);
// Of all methods, and of the matte format ("matte").
const std::map<std::string, int>& method_versions();
// The versions of a method and of the matte's file, which all tiles and parts of one matte share:
// "gaussian/1 matte/1".
std::string computes(const std::string& method);

// The option's accepted values: "a whole number, 1 to 8", "0 or 1", "adaptive, perona-malik or none".
std::string range_of(const MethodOption& option);

// Its help with range and default: "factor applied to highlights (0 to 100; default: 1)".
std::string description_of(const MethodOption& option);

// The values of a method's options: those given, or else the defaults.
class OptionValues {
 public:
  // INVALID_ARGUMENT names the option that the method does not have, that has an invalid value, or that needs
  // another option, and what would be accepted. check_method(method) is OK.
  static absl::StatusOr<OptionValues> read(std::string_view method,
                                           const std::map<std::string, std::string>& given);

  // False: not given, and the default depends on the frames.
  bool has(std::string_view option) const { return values_.contains(option); }
  // These need has().
  double number(std::string_view option) const;
  int whole(std::string_view option) const { return static_cast<int>(number(option)); }
  bool is_set(std::string_view option) const { return number(option) != 0.0; }
  const std::string& text(std::string_view option) const;

 private:
  std::map<std::string, std::string, std::less<>> values_;
};

// Splits "NAME=VALUE", the argument of --set. VALUE may be empty and may contain '='. INVALID_ARGUMENT: there
// is no '=', or NAME is empty.
absl::StatusOr<std::pair<std::string, std::string>> parse_setting(const std::string& setting);

}  // namespace glasswing
