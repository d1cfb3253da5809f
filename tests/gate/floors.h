// The floors of the gate: a table of what every composite must reach, made by `tests/gate/run --record` as
// what was reached then minus half a dB, and 80 dB at most.
#pragma once

#include <map>
#include <string>
#include <vector>

namespace glasswing::gate {

// A still or video, the method, noise in percent, and the picture behind the object.
struct Row {
  std::string scene, method, noise, background;
  auto operator<=>(const Row&) const = default;
  std::string text() const { return scene + "\t" + method + "\t" + noise + "\t" + background; }
};

// The rows of one method on one scene. Fails the test for a row without a floor, one below it, and, when
// destroyed, a floor without a row. With GLASSWING_RECORD_FLOORS=FILE it only appends the rows to that file.
class Floors {
 public:
  // The table is the file that the environment names in GLASSWING_FLOORS.
  Floors(const std::string& scene, const std::string& method);
  ~Floors();
  void reached(const std::string& noise, const std::string& background, double db);

 private:
  const std::string scene_, method_;
  std::map<Row, double> left_;  // rows that were not reached yet
};

// Fails the test if the table names a scene and method that are not among these.
void expect_no_other_floors(const std::map<std::string, std::vector<std::string>>& methods_of_scenes);

}  // namespace glasswing::gate
