// Every method of the server refuses a field beyond its limit, before it does anything else.

#include <grpcpp/generic/generic_stub.h>
#include <gtest/gtest.h>

#include "core/service/service.h"
#include "server/services/fleet_service.h"
#include "server/services/job_service.h"
#include "server/services/matte_service.h"
#include "server/services/queue_service.h"
#include "server/services/rig_service.h"
#include "server/services/server.h"
#include "server/services/session_service.h"
#include "server/services/storage_service.h"
#include "server/services/work_service.h"
#include "tests/support/temporary_directory.h"

namespace glasswing {
namespace {

namespace pb = google::protobuf;

// Makes the first string of the message, at any depth, too long. False: it has none.
bool overfill(pb::Message& message) {
  const pb::Reflection& reflection = *message.GetReflection();
  for (int i = 0; i < message.GetDescriptor()->field_count(); ++i) {
    const pb::FieldDescriptor& field = *message.GetDescriptor()->field(i);
    if (field.is_map()) continue;
    const bool list = field.is_repeated();
    if (field.type() == pb::FieldDescriptor::TYPE_STRING) {
      const std::string text(1 << 20, 'x');
      list ? reflection.AddString(&message, &field, text) : reflection.SetString(&message, &field, text);
      return true;
    }
    if (field.cpp_type() != pb::FieldDescriptor::CPPTYPE_MESSAGE) continue;
    pb::Message& nested =
        list ? *reflection.AddMessage(&message, &field) : *reflection.MutableMessage(&message, &field);
    if (overfill(nested)) return true;
    reflection.ClearField(&message, &field);
  }
  return false;
}

grpc::Status call(const ServiceHost& host, const pb::MethodDescriptor& method, const pb::Message& request) {
  grpc::GenericStub stub(host.to_itself());
  grpc::ClientContext context;
  set_deadline(context, std::chrono::seconds(20));
  grpc::CompletionQueue queue;
  const grpc::Slice bytes(request.SerializeAsString());
  const auto calling =
      stub.PrepareUnaryCall(&context, fmt::format("/{}/{}", method.service()->full_name(), method.name()),
                            grpc::ByteBuffer(&bytes, 1), &queue);
  calling->StartCall();
  grpc::ByteBuffer answer;
  grpc::Status status;
  calling->Finish(&answer, &status, nullptr);
  void* tag = nullptr;
  bool ok = false;
  queue.Next(&tag, &ok);
  return status;
}

TEST(Limits, HoldForEveryMethodOfTheServer) {
  const TemporaryDirectory data;
  {
    const std::unique_ptr<Server> server = Server::open({.data = data}).value();
    SessionServiceImpl sessions(*server);
    NodeServiceImpl nodes(*server);
    WorkServiceImpl work(*server);
    RigServiceImpl rig(*server);
    FleetServiceImpl fleet([&] { return server->fleet(); });
    MatteServiceImpl mattes(*server);
    QueueServiceImpl queue(*server);
    JobServiceImpl jobs(*server);
    StorageServiceImpl storage(server->storage());
    const auto host =
        ServiceHost::start({}, {&sessions, &nodes, &work, &rig, &fleet, &mattes, &queue, &jobs, &storage})
            .value();
    int refused = 0;
    for (const char* file : {"fleet", "job", "matte", "node", "queue", "rig", "session", "storage", "work"}) {
      const pb::FileDescriptor& described = *pb::DescriptorPool::generated_pool()->FindFileByName(
          fmt::format("glasswing/v1/{}_service.proto", file));
      const pb::ServiceDescriptor& service = *described.service(0);
      for (int i = 0; i < service.method_count(); ++i) {
        const pb::MethodDescriptor& method = *service.method(i);
        const std::unique_ptr<pb::Message> request(
            pb::MessageFactory::generated_factory()->GetPrototype(method.input_type())->New());
        if (!overfill(*request)) {
          EXPECT_TRUE(method.name() == "UploadImage" || method.name() == "ListMethods" ||
                      method.name() == "ReleaseRig" || method.name() == "ReleaseQueue" ||
                      method.name() == "ApplyRetention" || method.name().ends_with("QueueItem"))
              << method.name() << " has no string";
          continue;
        }
        const grpc::Status status = call(*host, method, *request);
        EXPECT_EQ(status.error_code(), grpc::StatusCode::INVALID_ARGUMENT) << method.full_name();
        EXPECT_NE(status.error_message().find("has 1048576 bytes; it must have at most"), std::string::npos)
            << method.full_name() << ": " << status.error_message();
        ++refused;
      }
    }
    EXPECT_GT(refused, 30);
    sessions.stop();
    rig.stop();
  }
}

}  // namespace
}  // namespace glasswing
