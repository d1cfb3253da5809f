// Runs on virtual cards of the kernel's vkms driver; tests/vm/run has three. On a real card these tests would
// take the console away from its user.
#include "display-node/backends/kms_display.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <sys/mman.h>
#include <unistd.h>
#include <xf86drm.h>
#include <xf86drmMode.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <iostream>
#include <map>
#include <random>
#include <set>
#include <string_view>

#include "tests/display-node/backends/display_contract.h"
#include "tests/display-node/backends/refresh_stamps.h"
#include "tests/support/status.h"

namespace glasswing {
namespace {

using std::chrono::microseconds;
using std::chrono::milliseconds;

constexpr char kLacking[] = "no vkms card here; tests/vm/run has three";

// Another program's view of a card.
class Onlooker {
 public:
  explicit Onlooker(const std::string& card) : fd_(::open(("/dev/dri/" + card).c_str(), O_RDWR | O_CLOEXEC)) {
    drmDropMaster(fd_);
  }
  ~Onlooker() { ::close(fd_); }
  Onlooker(const Onlooker&) = delete;
  Onlooker& operator=(const Onlooker&) = delete;

  std::string driver() const {
    drmVersion* version = drmGetVersion(fd_);
    const std::string name = version == nullptr ? "" : version->name;
    drmFreeVersion(version);
    return name;
  }
  // The only CRTC of a vkms card.
  drmModeCrtc crtc() const {
    drmModeRes* resources = drmModeGetResources(fd_);
    drmModeCrtc* found = drmModeGetCrtc(fd_, resources->crtcs[0]);
    const drmModeCrtc crtc = *found;
    drmModeFreeCrtc(found);
    drmModeFreeResources(resources);
    return crtc;
  }
  // Shows a picture of its own, 800 x 600 px, as another program does.
  void show_something() const {
    EXPECT_EQ(drmSetMaster(fd_), 0);
    std::uint32_t handle = 0, pitch = 0, framebuffer = 0;
    std::uint64_t size = 0;
    EXPECT_EQ(drmModeCreateDumbBuffer(fd_, 800, 600, 32, 0, &handle, &pitch, &size), 0);
    EXPECT_EQ(drmModeAddFB(fd_, 800, 600, 24, 32, pitch, handle, &framebuffer), 0);
    drmModeRes* resources = drmModeGetResources(fd_);
    drmModeConnector* connector = drmModeGetConnector(fd_, resources->connectors[0]);
    drmModeModeInfo* const modes = connector->modes;
    const auto mode = std::find_if(modes, modes + connector->count_modes, [](const drmModeModeInfo& each) {
      return each.hdisplay == 800 && each.vdisplay == 600;
    });
    EXPECT_EQ(drmModeSetCrtc(fd_, resources->crtcs[0], framebuffer, 0, 0, &connector->connector_id, 1, mode),
              0);
    drmModeFreeConnector(connector);
    drmModeFreeResources(resources);
    drmDropMaster(fd_);
  }
  // The refresh that began at that time.
  std::uint64_t refresh_at(nanoseconds start, double period_ns) const {
    std::uint64_t number = 0, now_ns = 0;
    EXPECT_EQ(drmCrtcGetSequence(fd_, crtc().crtc_id, &number, &now_ns), 0);
    const double since = static_cast<double>((nanoseconds(now_ns) - start).count()) / period_ns;
    return number - static_cast<std::uint64_t>(std::llround(since));
  }
  // The pixels that the CRTC shows now: blue, green, red, unused.
  std::vector<std::uint8_t> on_screen() const {
    std::vector<std::uint8_t> bytes;
    drmModeFB* shown = drmModeGetFB(fd_, crtc().buffer_id);
    std::uint64_t offset = 0;
    if (shown == nullptr || drmModeMapDumbBuffer(fd_, shown->handle, &offset) != 0) return bytes;
    const size_t size = size_t{shown->pitch} * shown->height, row = size_t{shown->width} * 4;
    void* mapped = ::mmap(nullptr, size, PROT_READ, MAP_SHARED, fd_, static_cast<off_t>(offset));
    if (mapped != MAP_FAILED) {
      const auto* from = static_cast<const std::uint8_t*>(mapped);
      for (size_t y = 0; y < shown->height; ++y)
        bytes.insert(bytes.end(), from + y * shown->pitch, from + y * shown->pitch + row);
      ::munmap(mapped, size);
    }
    drmModeFreeFB(shown);
    return bytes;
  }

 private:
  const int fd_;
};

std::vector<std::string> vkms_cards() {
  std::vector<std::string> cards;
  std::error_code none;
  for (const auto& entry : std::filesystem::directory_iterator("/dev/dri", none)) {
    const std::string card = entry.path().filename();
    if (card.starts_with("card") && Onlooker(card).driver().starts_with("vkms")) cards.push_back(card);
  }
  std::sort(cards.begin(), cards.end());
  return cards;
}

// "Virtual-1", from "/sys/class/drm/card0-Virtual-1".
std::string connector_of(const std::string& card) {
  for (const auto& entry : std::filesystem::directory_iterator("/sys/class/drm")) {
    const std::string name = entry.path().filename();
    if (name.starts_with(card + "-Virtual")) return name.substr(card.size() + 1);
  }
  return "";
}

KmsDisplay::Options small_monitors() {
  KmsDisplay::Options options{.monitors = {}, .lag = milliseconds(3), .settle = milliseconds(1)};
  for (const std::string& card : vkms_cards()) {
    options.monitors.push_back({.name = "on-" + card,
                                .connector = card + ":" + connector_of(card),
                                .width_px = 640,
                                .height_px = 480,
                                .refresh_hz = 60.0});
  }
  return options;
}

std::unique_ptr<Display> make_kms() {
  if (vkms_cards().empty()) return nullptr;
  return KmsDisplay::open(small_monitors()).value();
}

INSTANTIATE_TEST_SUITE_P(Kms, DisplayContract, testing::Values(make_kms));

class KmsDisplayTest : public testing::Test {
 protected:
  void SetUp() override {
    cards_ = vkms_cards();
    if (cards_.empty()) GTEST_SKIP() << kLacking;
  }
  std::vector<std::string> cards_;
};

Picture noise(const ScreenInfo& screen, unsigned seed) {
  auto image = std::make_shared<Image<std::uint16_t>>(screen.width_px, screen.height_px);
  std::mt19937 random(seed);
  for (std::uint16_t& code : image->samples)
    code = static_cast<std::uint16_t>(random() >> (32 - screen.bits));
  return image;
}

TEST_F(KmsDisplayTest, RefreshesAreStampedToAMicrosecond) {
  const std::unique_ptr<KmsDisplay> display = KmsDisplay::open(small_monitors()).value();
  expect_stamps_to_a_microsecond(*display, 1.0);  // vkms rounds its period to whole ns
}

TEST_F(KmsDisplayTest, ShowsAtTheFirstRefreshAtOrAfter) {
  const std::unique_ptr<KmsDisplay> display = KmsDisplay::open(small_monitors()).value();
  const std::vector<ScreenInfo>& screens = display->screens();
  std::vector<int> on_time(screens.size());
  std::vector<Scanout> before = display->show({}, monotonic_now()).value();
  constexpr int kTimes = 40;
  for (int i = 0; i < kTimes; ++i) {
    // At any phase of a refresh, some refreshes ahead.
    const nanoseconds at = before[0].start + nanoseconds(period_of(screens[0]).count() * (30 + 7 * i) / 10);
    const std::vector<Scanout> scanouts = display->show({}, at).value();
    for (size_t m = 0; m < screens.size(); ++m) {
      const double late = static_cast<double>((scanouts[m].start - at).count()) / period_ns_of(screens[m]);
      EXPECT_GE(scanouts[m].start, at - microseconds(1)) << screens[m].name;
      on_time[m] += late < 1.0 ? 1 : 0;
    }
    before = scanouts;
  }
  for (size_t m = 0; m < screens.size(); ++m) {
    // An emulated machine may sleep through a refresh, but not through all.
    EXPECT_GT(on_time[m], 0) << screens[m].name;
    std::cout << fmt::format("{}: {} of {} on time\n", screens[m].name, on_time[m], kTimes);
  }
}

TEST_F(KmsDisplayTest, TheCardShowsThePicturesCodes) {
  const std::unique_ptr<KmsDisplay> display = KmsDisplay::open(small_monitors()).value();
  const std::vector<ScreenInfo>& screens = display->screens();
  for (unsigned i = 0; i < 4; ++i) {
    std::vector<Picture> pictures;
    for (size_t m = 0; m < screens.size(); ++m)
      pictures.push_back(i == 2 && m == 0 ? nullptr : noise(screens[m], 10 * i + static_cast<unsigned>(m)));
    ASSERT_OK(display->show(pictures, monotonic_now()));
    for (size_t m = 0; m < screens.size(); ++m) {
      const std::vector<std::uint8_t> bytes = Onlooker(cards_[m]).on_screen();
      const size_t pixels = static_cast<size_t>(screens[m].width_px) * screens[m].height_px;
      ASSERT_EQ(bytes.size(), pixels * 4);
      size_t wrong = 0;
      for (size_t s = 0; s < pixels * 3; ++s) {
        const int shown = pictures[m] == nullptr ? 0 : pictures[m]->samples[s];
        wrong += bytes[s / 3 * 4 + 2 - s % 3] == shown ? 0 : 1;
      }
      EXPECT_EQ(wrong, 0u) << screens[m].name;
    }
  }
}

// The checksums that the driver computes of each refresh it scans out.
class Checksums {
 public:
  explicit Checksums(const std::string& card) {
    const std::string crc = "/sys/kernel/debug/dri/" + card.substr(4) + "/crtc-0/crc/";
    std::ofstream(crc + "control") << "auto";
    fd_ = ::open((crc + "data").c_str(), O_RDONLY | O_CLOEXEC | O_NONBLOCK);
  }
  ~Checksums() { ::close(fd_); }
  Checksums(const Checksums&) = delete;
  Checksums& operator=(const Checksums&) = delete;

  bool works() const { return fd_ >= 0; }
  // Those since the last call, by refresh.
  void read_into(std::map<std::uint64_t, std::uint64_t>& checksums) const {
    std::array<char, 128> line{};
    while (::read(fd_, line.data(), line.size() - 1) > 0) {
      unsigned long long refresh = 0, checksum = 0;
      if (std::sscanf(line.data(), "%llx %llx", &refresh, &checksum) == 2) checksums[refresh] = checksum;
    }
  }

 private:
  int fd_ = -1;
};

TEST_F(KmsDisplayTest, EachRefreshScansOutWhatTheReportSays) {
  for (size_t m = 0; m < cards_.size(); ++m) {
    const std::unique_ptr<KmsDisplay> display =
        KmsDisplay::open({.monitors = {small_monitors().monitors[m]}}).value();
    const ScreenInfo& screen = display->screens()[0];
    const Checksums driver(cards_[m]);
    if (!driver.works()) GTEST_SKIP() << "debugfs has no checksums of " << cards_[m];
    const std::array<Picture, 2> pictures{noise(screen, 1), noise(screen, 2)};
    std::map<std::uint64_t, std::uint64_t> checksums;
    std::map<std::uint64_t, size_t> reported;  // the picture from that refresh on
    nanoseconds at = monotonic_now();
    for (size_t i = 0; i < 60; ++i) {
      const Scanout scanout = display->show({pictures[i % 2]}, at).value().front();
      reported[Onlooker(cards_[m]).refresh_at(scanout.start, period_ns_of(screen))] = i % 2;
      at = scanout.start + nanoseconds(period_of(screen).count() * static_cast<int>(2 * (i % 3) + 1) / 2);
      driver.read_into(checksums);
    }
    ASSERT_EQ(reported.size(), 60u);
    std::array<std::set<std::uint64_t>, 2> seen;
    for (const auto& [refresh, checksum] : checksums) {
      const auto after = reported.upper_bound(refresh);
      if (after != reported.begin() && after != reported.end())
        seen[std::prev(after)->second].insert(checksum);
    }
    ASSERT_EQ(seen[0].size(), 1u) << cards_[m];
    ASSERT_EQ(seen[1].size(), 1u) << cards_[m];
    EXPECT_NE(*seen[0].begin(), *seen[1].begin());
    std::cout << fmt::format("{}: {} refreshes checked\n", screen.name, checksums.size());
  }
}

TEST_F(KmsDisplayTest, TheModesTimingsAreTheScreens) {
  const std::unique_ptr<KmsDisplay> display = KmsDisplay::open(small_monitors()).value();
  for (size_t m = 0; m < cards_.size(); ++m) {
    const drmModeModeInfo mode = Onlooker(cards_[m]).crtc().mode;
    const ScreenInfo& screen = display->screens()[m];
    EXPECT_EQ(mode.hdisplay, 640);
    EXPECT_EQ(screen.width_px, 640);
    EXPECT_EQ(screen.height_px, 480);
    EXPECT_NEAR(period_ns_of(screen), 1e6 * mode.htotal * mode.vtotal / mode.clock, 1.0);
    EXPECT_NEAR(static_cast<double>(screen.scanout.count()), 1e6 * mode.htotal * mode.vdisplay / mode.clock,
                1.0);
  }
}

TEST_F(KmsDisplayTest, AllThatArePluggedInIfNoneIsNamed) {
  const std::unique_ptr<KmsDisplay> display = KmsDisplay::open({}).value();
  ASSERT_GE(display->screens().size(), cards_.size());
  for (size_t m = 0; m < cards_.size(); ++m) EXPECT_EQ(display->screens()[m].name, connector_of(cards_[m]));
  EXPECT_OK(display->show({}, monotonic_now()));
}

TEST_F(KmsDisplayTest, TheConsoleIsAsItWas) {
  for (const bool in_use : {false, true}) {
    for (const std::string& card : cards_) {
      const Onlooker onlooker(card);
      if (in_use) onlooker.show_something();
      const drmModeCrtc before = onlooker.crtc();
      {
        const std::unique_ptr<KmsDisplay> display = KmsDisplay::open(small_monitors()).value();
        ASSERT_OK(display->show({}, monotonic_now()));
        EXPECT_EQ(onlooker.crtc().mode.hdisplay, 640);
        EXPECT_NE(onlooker.crtc().buffer_id, before.buffer_id);
      }
      const drmModeCrtc after = onlooker.crtc();
      EXPECT_EQ(after.buffer_id, before.buffer_id);
      EXPECT_EQ(after.mode_valid, before.mode_valid);
      EXPECT_EQ(after.mode.hdisplay, before.mode.hdisplay);
      EXPECT_EQ(after.mode.clock, before.mode.clock);
    }
  }
}

TEST_F(KmsDisplayTest, AnUnpluggedMonitorIsNamed) {
  const std::string card = cards_.back();
  const std::string status = fmt::format("/sys/class/drm/{}-{}/status", card, connector_of(card));
  const auto plug = [&](const char* how) {
    return static_cast<bool>(std::ofstream(status) << how << std::flush);
  };
  const std::unique_ptr<KmsDisplay> display = KmsDisplay::open(small_monitors()).value();
  ASSERT_OK(display->show({}, monotonic_now()));
  ASSERT_TRUE(plug("off"));
  const absl::Status unplugged = display->show({}, monotonic_now()).status();
  const absl::Status not_found =
      KmsDisplay::open({.monitors = {{.name = "back", .connector = connector_of(card)}}}).status();
  ASSERT_TRUE(plug("detect"));
  EXPECT_TRUE(absl::IsUnavailable(unplugged)) << unplugged;
  EXPECT_NE(std::string(unplugged.message()).find("\"on-" + card + "\" was unplugged"), std::string::npos)
      << unplugged;
  EXPECT_TRUE(absl::IsNotFound(not_found)) << not_found;
  EXPECT_NE(std::string(not_found.message()).find("nothing plugged in"), std::string::npos) << not_found;
  EXPECT_OK(display->show({}, monotonic_now()));
}

TEST_F(KmsDisplayTest, SaysWhatIsWrong) {
  const std::string card = cards_.front(), connector = connector_of(card);
  const auto error_of = [](std::vector<KmsDisplay::Monitor> monitors) {
    return KmsDisplay::open({.monitors = std::move(monitors)}).status();
  };
  const auto says = [](const absl::Status& status, const std::string& words) {
    EXPECT_NE(std::string(status.message()).find(words), std::string::npos) << status;
  };
  const absl::Status unknown = error_of({{.name = "back", .connector = "HDMI-A-7"}});
  EXPECT_TRUE(absl::IsNotFound(unknown));
  says(unknown, "HDMI-A-7");
  for (const std::string& each : cards_) says(unknown, each + ":" + connector_of(each) + " (1024x768@60)");

  const absl::Status size =
      error_of({{.name = "back", .connector = connector, .width_px = 641, .height_px = 480}});
  EXPECT_TRUE(absl::IsNotFound(size));
  says(size, "641 x 480");
  says(size, "640x480@");

  const absl::Status twice = error_of(
      {{.name = "back", .connector = connector}, {.name = "left", .connector = card + ":" + connector}});
  EXPECT_TRUE(absl::IsInvalidArgument(twice));
  says(twice, connector);

  // vkms supports XRGB8888, but not XRGB2101010.
  const absl::Status deep =
      KmsDisplay::open({.monitors = {{.name = "back", .connector = connector}}, .bits = 10}).status();
  EXPECT_TRUE(absl::IsFailedPrecondition(deep)) << deep;
  says(deep, "codes of 10 bits");
  says(deep, "available: 8");

  const std::unique_ptr<KmsDisplay> holder = KmsDisplay::open(small_monitors()).value();
  const absl::Status held = error_of({{.name = "back", .connector = connector}});
  EXPECT_TRUE(absl::IsFailedPrecondition(held));
  says(held, "holds " + card);
}

TEST(KmsDisplay, AMachineWithoutACardSaysSo) {
  std::error_code none;
  if (std::filesystem::exists("/dev/dri", none)) GTEST_SKIP() << "this machine has graphics cards";
  const absl::Status status = KmsDisplay::open({}).status();
  EXPECT_TRUE(absl::IsNotFound(status));
  EXPECT_NE(std::string(status.message()).find("/dev/dri/card*"), std::string::npos) << status;
}

}  // namespace
}  // namespace glasswing
