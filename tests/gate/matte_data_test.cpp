// A recorded rig session, whose scene's rays are known: what its matte says of itself is true.
#include <gtest/gtest.h>

#include <cmath>
#include <cstdlib>
#include <filesystem>

#include "core/import/mapped_archive.h"
#include "core/sim/scene.h"
#include "core/sim/transport.h"
#include "solver/methods.h"
#include "solver/worker/parallel_solve.h"
#include "tests/gate/matte_report.h"
#include "tests/support/status.h"

namespace glasswing::gate {
namespace {

// Where the rays of a simulated camera's pixel end on the back monitor, whose last rows show an id patch.
class RayTruth {
 public:
  RayTruth(const std::string& scene, MonitorSize shown, MonitorSize camera)
      : shown_(shown), camera_(camera), scene_(make_scene(scene, shown).value()) {}

  std::vector<TrueMode> operator()(int x, int y, int channel) const {
    std::vector<TrueMode> groups;
    for (int s = 0; s < kRaysAcross * kRaysAcross; ++s) {
      const Ray seen = ray(x, y, s);
      const int number = (y * kRaysAcross + s / kRaysAcross) % kRaysAcross * kRaysAcross +
                         (x * kRaysAcross + s % kRaysAcross) % kRaysAcross;
      const auto paths = scene_->trace(seen, channel, number);
      if (!paths) add(seen, 1.0, groups);
      for (const Path& path : paths.value_or(std::vector<Path>{})) add(path.ray, path.weight, groups);
    }
    std::erase_if(groups, [](const TrueMode& group) { return group.weight < kFaint; });
    std::ranges::sort(groups, [](const TrueMode& a, const TrueMode& b) { return a.weight > b.weight; });
    return groups;
  }

 private:
  static constexpr double kApart_px = 2.0;  // half a stripe's sigma: rays that are closer are one footprint
  static constexpr double kFaint = 0.004;   // of white: four times the camera's noise

  Ray ray(int x, int y, int number) const {
    const Vec3 eye{0.5 * shown_.width_px, 0.5 * shown_.height_px, -kFocalWidths * shown_.width_px};
    const Vec3 target{(x + (number % kRaysAcross + 0.5) / kRaysAcross) * shown_.width_px / camera_.width_px,
                      (y + (number / kRaysAcross + 0.5) / kRaysAcross) * shown_.height_px / camera_.height_px,
                      0.0};
    return {eye, normalized(target - eye)};
  }
  // Joins the groups that the ray lies near to.
  void add(const Ray& ray, double weight, std::vector<TrueMode>& groups) const {
    if (!(ray.direction.z > 0.0)) return;
    const Vec3 end = ray.origin + (-ray.origin.z / ray.direction.z) * ray.direction;
    if (end.x < 0.0 || end.y < 0.0 || end.x >= shown_.width_px || end.y >= shown_.height_px - kPatchRows)
      return;
    weight /= kRaysAcross * kRaysAcross;
    TrueMode own{.weight = weight, .x_px = end.x, .y_px = end.y};
    std::erase_if(groups, [&](const TrueMode& group) {
      if (std::hypot(group.x_px - end.x, group.y_px - end.y) > kApart_px) return false;
      const double sum = own.weight + group.weight;
      own.x_px = (own.weight * own.x_px + group.weight * group.x_px) / sum;
      own.y_px = (own.weight * own.y_px + group.weight * group.y_px) / sum;
      own.weight = sum;
      return true;
    });
    groups.push_back(own);
  }
  static constexpr int kPatchRows = 8;

  const MonitorSize shown_, camera_;
  const std::shared_ptr<const Scene> scene_;
};

TEST(MatteData, TheRigsCrystalKnowsWhatItKnows) {
  const char* const data = std::getenv("GLASSWING_DATA");
  const std::filesystem::path directory = std::filesystem::path(data != nullptr ? data : "") / "rig_crystal";
  if (data == nullptr || !std::filesystem::exists(directory))
    GTEST_SKIP() << "no recorded rig session (GLASSWING_DATA)";
  const auto archive = MappedArchive::open(directory);
  ASSERT_OK(archive);
  const auto matte = solve_archive(*make_method("gaussian", {}).value(), **archive);
  ASSERT_OK(matte);
  const RayTruth truth("crystal", {.width_px = 128, .height_px = 104}, {.width_px = 128, .height_px = 104});
  const MatteReport report = report_on(*matte, truth);
  std::printf("%s", report.text().c_str());
  EXPECT_EQ(report.object, 5149);
  EXPECT_LE(report.flagged, 40);
  EXPECT_EQ(report.phantoms, 0);
  EXPECT_LE(report.sigma_px.most, 1.5);
  EXPECT_LE(report.centre_sd_px.most, 1.5);
  EXPECT_NEAR(report.many(), report.truly_many(), 0.03);
  EXPECT_GE(report.within_one, 0.65);
  EXPECT_LE(report.within_one, 0.72);
}

}  // namespace
}  // namespace glasswing::gate
