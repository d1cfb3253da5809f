// A tethered camera as a program: takes one picture of what the simulated monitors show and writes it into a
// folder, as gphoto2 --capture-image-and-download does; or does something worse.
#include <fmt/format.h>
#include <sys/stat.h>
#include <unistd.h>

#include <CLI/CLI.hpp>
#include <cstdlib>
#include <iostream>
#include <random>
#include <thread>

#include "camera-node/backends/emission_client.h"
#include "camera-node/backends/sim_camera.h"
#include "core/file/file.h"
#include "core/image/image_file.h"
#include "core/image/mosaic.h"
#include "tests/core/image/dng.h"

namespace glasswing {
namespace {

namespace fs = std::filesystem;

struct Faults {
  double late = 0.0, twice = 0.0, cut = 0.0, slow = 0.0, swapped = 0.0, lost = 0.0, stale = 0.0;
};

struct Options {
  std::string tap, folder, state, mosaic;
  int width_px = 192, height_px = 144;
  double exposure_ms = 10.0, late_s = 3.0;
  bool capped = false;  // its lens
  bool jpeg = false;
  Faults faults;
};

Image16 exposed(const Options& options) {
  if (options.capped) {
    Image16 dark(options.width_px, options.height_px);
    // No picture's file is that of another.
    auto number = static_cast<std::uint64_t>(monotonic_now().count());
    for (size_t i = 0; number > 0; ++i, number /= 64)
      dark.samples[i] = static_cast<std::uint16_t>(number % 64);
    return dark;
  }
  EmissionTimeline timeline;
  const EmissionClient light(options.tap, timeline);
  if (!timeline.wait_known_until(monotonic_now(), std::chrono::seconds(20))) {
    std::cerr << "the stand-in sees no display\n";
    std::exit(1);
  }
  SimCameraOptions sim;
  sim.scene = "none";
  sim.width_px = options.width_px;
  sim.height_px = options.height_px;
  sim.frame_rate_hz = 20.0;
  sim.sensor.seed =
      static_cast<std::uint64_t>(monotonic_now().count());  // its noise makes each picture another file
  sim.sensor.full_scale_exposure_ms = options.exposure_ms;
  sim.mosaic = options.mosaic;
  const auto camera = SimCamera::create(sim, timeline).value();
  while (camera->describe().has_preparation()) std::this_thread::sleep_for(std::chrono::milliseconds(1));
  if (!camera->start(options.exposure_ms).ok()) std::exit(2);
  std::optional<CapturedFrame> frame;
  while (!frame) frame = camera->next(std::chrono::seconds(1));
  return frame->image().value();
}

std::string file_of(const Options& options, const Image16& image) {
  if (options.jpeg) {
    RadianceImage light(image.width_px, image.height_px);
    std::ranges::transform(image.samples, light.samples.begin(), radiance_of);
    return encode_jpeg(light).value();
  }
  if (options.mosaic.empty()) return encode_png16(image).value();
  const fs::path path = fs::path(options.state) / "picture.dng";
  constexpr std::uint32_t kWhite = 4095;
  Dng dng{.width_px = image.width_px,
          .height_px = image.height_px,
          .codes = {},
          .bits = 16,
          .mosaic = options.mosaic};
  dng.white = kWhite;
  dng.exposure_s = 1e-3 * options.exposure_ms;
  dng.iso = 100;
  for (const std::uint16_t sample : image.samples)
    dng.codes.push_back(
        static_cast<std::uint16_t>(std::lround(sample * static_cast<double>(kWhite) / 65535.0)));
  write_dng(path, dng);
  return read_file(path).value();
}

class Card {
 public:
  // A program runs for one picture only, so that their number, the size of a file, makes each picture's
  // faults.
  explicit Card(const Options& options) : options_(options) {
    const fs::path taken = fs::path(options.state) / "taken";
    std::error_code none_yet;
    const auto count = fs::file_size(taken, none_yet);
    first_ = static_cast<bool>(none_yet);
    append(taken, ".");
    random_.seed(first_ ? 0 : static_cast<unsigned>(count));
  }

  // Names that say nothing about the order.
  fs::path new_name() {
    return fs::path(options_.folder) / fmt::format("IMG_{:08x}.{}", random_(),
                                                   options_.jpeg             ? "jpg"
                                                   : options_.mosaic.empty() ? "png"
                                                                             : "dng");
  }
  void put(std::string_view bytes) { append(new_name(), bytes); }
  static void append(const fs::path& path, std::string_view bytes) {
    FILE* const file = std::fopen(path.c_str(), "a");
    std::fwrite(bytes.data(), 1, bytes.size(), file);
    std::fclose(file);
  }
  void note(const std::string& what) { append(fs::path(options_.state) / "faults", what + "\n"); }
  // Nothing is wrong with the first picture, which tells what the others are like.
  bool chance(double probability) { return !first_ && std::bernoulli_distribution(probability)(random_); }

 private:
  const Options& options_;
  bool first_ = true;
  std::mt19937 random_;
};

void deliver(const Options& options, const std::string& bytes) {
  Card card(options);
  const Faults& faults = options.faults;
  const fs::path held = fs::path(options.state) / "held", before = fs::path(options.state) / "before";
  if (fs::exists(held)) {  // this one comes first, then the one that was held back
    const std::string earlier = read_file(held).value();
    fs::remove(held);
    card.put(bytes);
    std::this_thread::sleep_for(std::chrono::milliseconds(50));
    return card.put(earlier);
  }
  if (card.chance(faults.swapped)) {
    card.note("swapped");
    return Card::append(held, bytes);
  }
  if (card.chance(faults.lost)) return card.note("lost");
  if (fs::exists(before) && card.chance(faults.stale)) {
    card.note("stale");  // the picture of an earlier step, in a file that is not equal to its own
    return card.put(read_file(before).value() + " ");
  }
  fs::remove(before);
  Card::append(before, bytes);
  if (card.chance(faults.late)) {
    card.note("late");
    if (::fork() != 0) return;
    ::setsid();
    for (const int fd : {0, 1, 2}) ::close(fd);
    std::this_thread::sleep_for(std::chrono::duration<double>(options.late_s));
    card.put(bytes);
    ::_exit(0);
  }
  if (card.chance(faults.cut)) {
    card.note("cut");
    return card.put(bytes.substr(0, bytes.size() / 2));
  }
  if (card.chance(faults.slow)) {
    card.note("slow");
    const fs::path name = card.new_name();
    Card::append(name, bytes.substr(0, bytes.size() / 3));
    std::this_thread::sleep_for(std::chrono::milliseconds(700));
    return Card::append(name, bytes.substr(bytes.size() / 3));
  }
  card.put(bytes);
  if (!card.chance(faults.twice)) return;
  card.note("twice");
  card.put(bytes);
}

}  // namespace
}  // namespace glasswing

int main(int argc, char** argv) {
  using namespace glasswing;
  Options options;
  CLI::App app("Takes a picture of simulated monitors.");
  app.add_option("--tap", options.tap)->required();
  app.add_option("--folder", options.folder)->required();
  app.add_option("--state", options.state, "directory that it keeps between pictures")->required();
  app.add_option("--mosaic", options.mosaic, "writes DNGs of it; else PNG");
  app.add_option("--width", options.width_px);
  app.add_option("--height", options.height_px);
  app.add_option("--exposure-ms", options.exposure_ms);
  app.add_option("--late-s", options.late_s);
  app.add_flag("--jpeg", options.jpeg, "writes JPEGs");
  app.add_flag("--capped", options.capped, "leaves the cap on its lens");
  Faults& faults = options.faults;
  for (const auto& [name, value] : {std::pair{"--late", &faults.late}, std::pair{"--twice", &faults.twice},
                                    std::pair{"--cut", &faults.cut}, std::pair{"--slow", &faults.slow},
                                    std::pair{"--swapped", &faults.swapped},
                                    std::pair{"--lost", &faults.lost}, std::pair{"--stale", &faults.stale}})
    app.add_option(name, *value, "probability of this fault");
  CLI11_PARSE(app, argc, argv);
  std::filesystem::create_directories(options.state);
  deliver(options, file_of(options, exposed(options)));
  return 0;
}
