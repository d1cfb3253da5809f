#include "tests/gate/floors.h"

#include <fmt/format.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <fstream>
#include <sstream>

namespace glasswing::gate {
namespace {

constexpr double kMargin_db = 0.5;
// A ten-thousandth of full scale. What is better than that depends on the processor's vector instructions.
constexpr double kMaxFloor_db = 80.0;

const char* record_file() {
  return std::getenv("GLASSWING_RECORD_FLOORS");
}

// Lines of scene, method, noise, background and floor, separated by tabs; the first is the heading.
std::map<Row, double> table() {
  const char* const path = std::getenv("GLASSWING_FLOORS");
  std::ifstream file(path == nullptr ? "" : path);
  if (!file) ADD_FAILURE() << "GLASSWING_FLOORS is no table: " << (path == nullptr ? "" : path);
  std::map<Row, double> floors;
  std::string line;
  std::getline(file, line);
  while (std::getline(file, line)) {
    std::istringstream fields(line);
    Row row;
    double floor_db = NAN;
    fields >> row.scene >> row.method >> row.noise >> row.background >> floor_db;
    EXPECT_TRUE(fields) << path << ": " << line;
    EXPECT_TRUE(floors.emplace(row, floor_db).second) << path << ": twice: " << line;
  }
  return floors;
}

}  // namespace

Floors::Floors(const std::string& scene, const std::string& method) : scene_(scene), method_(method) {
  if (record_file() != nullptr) return;
  left_ = table();
  std::erase_if(left_,
                [&](const auto& each) { return each.first.scene != scene || each.first.method != method; });
}

Floors::~Floors() {
  for (const auto& [row, floor_db] : left_)
    ADD_FAILURE() << "a floor of what is not measured (any more): " << row.text() << "\t" << floor_db;
}

void Floors::reached(const std::string& noise, const std::string& background, double db) {
  const Row row{scene_, method_, noise, background};
  if (record_file() != nullptr) {
    ASSERT_TRUE(std::isfinite(db)) << row.text();
    std::ofstream(record_file(), std::ios::app)
        << row.text()
        << fmt::format("\t{:.1f}\n", std::min(std::floor(10.0 * (db - kMargin_db)) / 10.0, kMaxFloor_db));
    return;
  }
  const auto found = left_.find(row);
  ASSERT_NE(found, left_.end()) << "no floor: " << row.text() << fmt::format(" reaches {:.2f} dB", db);
  std::printf("%-16s %-13s noise %-4s %-16s %6.2f dB, floor %5.1f\n", scene_.c_str(), method_.c_str(),
              noise.c_str(), background.c_str(), db, found->second);
  EXPECT_GE(db, found->second) << row.text();
  left_.erase(found);
}

void expect_no_other_floors(const std::map<std::string, std::vector<std::string>>& methods_of_scenes) {
  if (record_file() != nullptr) return;
  for (const auto& [row, floor_db] : table()) {
    const auto scene = methods_of_scenes.find(row.scene);
    EXPECT_TRUE(scene != methods_of_scenes.end() && std::ranges::count(scene->second, row.method) > 0)
        << "a floor of what is not measured (any more): " << row.text();
  }
}

}  // namespace glasswing::gate
