// Solves one of the gate's scenes, at 0.5 % of noise: what instructions_test.py counts the instructions of.
//   gate-solve-scene SCENE WAY   prints how many channels of pixels show the object
#include <valgrind/callgrind.h>

#include <algorithm>
#include <cstdio>
#include <string_view>

#include "solver/methods.h"
#include "solver/worker/parallel_solve.h"
#include "tests/gate/scene.h"
#include "tests/gate/ways.h"
#include "tests/solver/stack_of.h"

int main(int count, char** words) {
  using namespace glasswing;
  if (count != 3) return 2;
  const std::vector<gate::Scene> scenes = gate::analytic_scenes();
  const auto scene = std::ranges::find(scenes, std::string_view(words[1]), &gate::Scene::name);
  const auto way = gate::ways().find(words[2]);
  if (scene == scenes.end() || way == gate::ways().end()) return 2;
  gate::Recording recording = gate::recorded(*scene, way->second.plan);
  // Plans are designed for a camera whose noise is known.
  if (way->first == "designed") recording.manifest.mutable_camera()->set_read_sd(0.005);
  const std::vector<Image16> frames = gate::noisy(recording.frames, 0.005);
  const auto method = make_method(way->second.method, way->second.options).value();
  CALLGRIND_START_INSTRUMENTATION;
  const auto matte = solve_in_bands(*method, recording.manifest, stack_of(recording.manifest, frames), 1);
  CALLGRIND_STOP_INSTRUMENTATION;
  if (!matte.ok()) return 1;
  std::printf("%td\n", kChannels * std::ranges::count(scene->inside, true));
}
