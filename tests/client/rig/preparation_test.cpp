// What nodes and preview say of a camera that prepares, against a fake rig.
#include <gmock/gmock.h>

#include <fstream>
#include <nlohmann/json.hpp>
#include <sstream>

#include "core/service/service.h"
#include "glasswing/v1/camera_service.grpc.pb.h"
#include "glasswing/v1/node_service.grpc.pb.h"
#include "tests/client/run_glasswing.h"

namespace glasswing {
namespace {

using testing::HasSubstr;

// A server and a camera node at one address, whose camera gives a picture after it has prepared.
struct Rig final : v1::NodeService::Service {
  v1::ListNodesResponse listed;
  grpc::Status ListNodes(grpc::ServerContext*, const v1::ListNodesRequest*,
                         v1::ListNodesResponse* response) override {
    *response = listed;
    return grpc::Status::OK;
  }
};
struct Camera final : v1::CameraService::Service {
  grpc::Status Preview(grpc::ServerContext*, const v1::PreviewRequest*,
                       grpc::ServerWriter<v1::PreviewResponse>* writer) override {
    v1::PreviewResponse response;
    response.mutable_preparation()->set_what("waiting for the monitors' light");
    writer->Write(response);
    response.mutable_preparation()->set_what("simulating the scene");
    response.mutable_preparation()->set_done(0.25);
    writer->Write(response);
    response.clear_preparation();
    response.set_jpeg("picture");
    writer->Write(response);
    return grpc::Status::OK;
  }
};

class PreparingCamera : public ScratchTest {
 protected:
  PreparingCamera() : host_(ServiceHost::start({}, {&rig_, &camera_}).value()) {
    v1::Node& node = *rig_.listed.add_nodes();
    node.set_kind(v1::NODE_KIND_CAMERA);
    node.set_name("camera-1");
    node.set_address(host_->address());
    node.set_up(true);
    node.set_detail("sim 640x488");
    node.mutable_preparation()->set_what("simulating the scene");
    node.mutable_preparation()->set_done(0.379);
  }
  Outcome run(std::vector<std::string> command) const {
    command.insert(command.end(), {"--server", host_->address()});
    return run_glasswing(command);
  }

  Rig rig_;
  Camera camera_;
  std::unique_ptr<ServiceHost> host_;
};

TEST_F(PreparingCamera, IsListedWithWhatItDoes) {
  const Outcome table = run({"nodes", "--tsv"});
  EXPECT_EQ(table.status, 0) << table.err;
  EXPECT_THAT(table.out, HasSubstr("\tpreparing\t"));
  EXPECT_THAT(table.out, HasSubstr("\tsimulating the scene, 37 %; sim 640x488\n"));
  const nlohmann::json node = nlohmann::json::parse(run({"nodes", "--json"}).out)["nodes"][0];
  EXPECT_EQ(node["up"], true);
  EXPECT_EQ(node["preparation"]["what"], "simulating the scene");
  EXPECT_EQ(node["preparation"]["done"], 0.379);
  rig_.listed.mutable_nodes(0)->clear_preparation();
  EXPECT_THAT(run({"nodes", "--tsv"}).out, HasSubstr("\tup\t"));
  EXPECT_FALSE(nlohmann::json::parse(run({"nodes", "--json"}).out)["nodes"][0].contains("preparation"));
}

TEST_F(PreparingCamera, IsWaitedForByAPreview) {
  const std::string file = scratch_ / "live.jpg";
  const Outcome lines = run({"preview", "--count", "1", "-o", file, "--json"});
  EXPECT_EQ(lines.status, 0) << lines.err;
  std::istringstream in(lines.out);
  std::vector<nlohmann::json> told;
  for (std::string line; std::getline(in, line);) told.push_back(nlohmann::json::parse(line));
  ASSERT_EQ(told.size(), 3u) << lines.out;
  EXPECT_EQ(told[0], nlohmann::json({{"preparation", "waiting for the monitors' light"}}));
  EXPECT_EQ(told[1], nlohmann::json({{"preparation", "simulating the scene"}, {"done", 0.25}}));
  EXPECT_EQ(told[2]["file"], file);
  std::ifstream written(file);
  EXPECT_EQ(std::string(std::istreambuf_iterator<char>(written), {}), "picture");
  // The time is short, so that its progress is not told.
  const Outcome text = run({"preview", "--count", "1", "-o", file});
  EXPECT_EQ(text.status, 0) << text.err;
  EXPECT_TRUE(text.out.starts_with(file)) << text.out;
}

}  // namespace
}  // namespace glasswing
