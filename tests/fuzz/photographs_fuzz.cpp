// Lists of imported photographs (docs/archive.md).
#include "client/exchange/photograph_list.h"
#include "core/frame/archive.h"
#include "core/import/photograph_response.h"
#include "tests/fuzz/fuzz_target.h"

namespace glasswing::fuzz {

std::vector<std::string> seeds() {
  const std::string head =
      "# photographs of a glass\n#monitor back:64x48\n#response gamma:2.2\n#black 64\n#scene a glass\n";
  return {head +
              "file\tobject\tkind\tcolour\ttime_s\texposure_ms\nblack.png\tfalse\tsolid\t0,0,0\t1.5\t4\n"
              "white.png\ttrue\tsolid\t1,1,0.5\t\t\n",
          "#monitor back:64x48\r\n#monitor left:32x32\r\n#response srgb\r\n"
          "file\tobject\tkind\tpanel\tphi_deg\tr_px\tsigma_px\tpeak\tname\treference\r\n"
          "a.tif\ttrue\tgauss_stripe\tleft\t-45\t3.5\t4\t1\t\t\r\nb."
          "jpg\ttrue\tphoto\tback\t\t\t\t\tstone\ttrue\r\n",
          head +
              "file\tobject\tkind\torient\tlevel\tbar_width_px\tinverse\tpatch_id\n"
              "c.png\tfalse\tsquare\tvertical_bars\t3\t8\ttrue\t\nd.png\tfalse\tpatch\t\t\t\t\t7\n",
          "#monitor back:-1x99999999999\nfile\tobject\tkind\na\ttrue\tramp\n"};
}

void try_input(std::string_view input) {
  const std::filesystem::path path = scratch_directory() / "photos.tsv";
  write_plainly(path, input);
  const absl::StatusOr<PhotographList> list = read_photograph_list(path, {});
  if (!list.ok()) {
    FUZZ_CHECK(list.status().message().find(path.string()) == 0);
    return;
  }
  FUZZ_CHECK(list->manifest.frames_size() == static_cast<int>(list->lines.size()));
  FUZZ_CHECK(list->black >= 0.0 && list->black <= 65535.0);
  for (int i = 0; i < list->manifest.frames_size(); ++i) {
    const size_t at = i;
    FUZZ_CHECK(list->lines[at] >= 1 && (i == 0 || list->lines[at] > list->lines[at - 1]));
    FUZZ_CHECK(check_frame(list->manifest.frames(i)).ok());
  }
  // With a camera it is a manifest, which every program must be able to read.
  v1::CaptureManifest manifest = list->manifest, read;
  manifest.mutable_camera()->set_width_px(1);
  manifest.mutable_camera()->set_height_px(1);
  const absl::Status whole = check_manifest(manifest);  // it may name a monitor twice
  FUZZ_CHECK(whole.ok() || !whole.message().empty());
  FUZZ_CHECK(read.ParseFromString(manifest.SerializeAsString()));
  const absl::Status response = PhotographResponse::create(list->response, 0.0).status();
  FUZZ_CHECK(response.ok() || response.message().find(list->response) != std::string_view::npos);
}

}  // namespace glasswing::fuzz
