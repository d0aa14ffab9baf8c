// Networks made for the test: namespaces with their own interfaces, joined by virtual cables. Needs
// root.
#include <cstdlib>
#include <fstream>

#include <gtest/gtest.h>

#include "tests/idl/dds_support.h"
#include "tests/support/process.h"

namespace tbm::dds::test {
namespace {

using ::tbm::test::Process;

const std::string kPeer = TBM_PEER;

bool Shell(const std::string& command) {
  return std::system((command + " 2>/dev/null").c_str()) == 0;
}

// A network namespace of its own, gone with the object. Without IPv6, so that the kernel itself has
// nothing to say on a quiet cable.
class Namespace {
 public:
  explicit Namespace(const std::string& name) : name_(name + std::to_string(getpid())) {
    Shell("ip netns del " + name_);
    is_made_ =
        Shell("ip netns add " + name_) &&
        In("sysctl -qw net.ipv6.conf.all.disable_ipv6=1 net.ipv6.conf.default.disable_ipv6=1") &&
        Ip("link set lo up");
  }
  ~Namespace() { Shell("ip netns del " + name_); }
  Namespace(const Namespace&) = delete;
  Namespace& operator=(const Namespace&) = delete;

  bool is_made() const { return is_made_; }
  const std::string& name() const { return name_; }
  bool In(const std::string& command) const {
    return Shell("ip netns exec " + name_ + " " + command);
  }
  bool Ip(const std::string& command) const { return Shell("ip -n " + name_ + " " + command); }
  std::vector<std::string> Command(std::vector<std::string> words) const {
    words.insert(words.begin(), {"ip", "netns", "exec", name_});
    return words;
  }

 private:
  std::string name_;
  bool is_made_ = false;
};

class Network : public testing::Test {
 protected:
  void SetUp() override {
    if (geteuid() != 0) GTEST_SKIP() << "network namespaces need root";
    if (!Namespace("tbmprobe").is_made()) GTEST_SKIP() << "this kernel gives no network namespaces";
  }
  static std::size_t Poses(const Process& reader) {
    std::size_t count = 0;
    for (const std::string& line : reader.Lines()) count += line.rfind("pose ", 0) == 0;
    return count;
  }
};

// Two machines, `a` and `b`, on a switch whose ports can be pulled while both keep their addresses.
class TwoMachines {
 public:
  TwoMachines() : a("tbma"), b("tbmb"), hub("tbmh") {
    is_made = a.is_made() && b.is_made() && hub.is_made() &&
              hub.Ip("link add br0 type bridge mcast_snooping 0") && hub.Ip("link set br0 up");
    for (const auto& [machine, port] : {std::pair{&a, "pa"}, std::pair{&b, "pb"}}) {
      is_made = is_made &&
                hub.Ip(std::string("link add ") + port + " type veth peer name cable netns " +
                       machine->name()) &&
                hub.Ip(std::string("link set ") + port + " master br0 up") &&
                machine->Ip("link set cable up");
    }
  }

  Namespace a;
  Namespace b;
  Namespace hub;
  bool is_made = false;
};

TEST_F(Network, AProcessStartedBeforeItsAddressExistsWaitsForIt) {
  const TwoMachines net;
  ASSERT_TRUE(net.is_made);
  ASSERT_TRUE(net.a.Ip("addr add 10.77.0.1/24 dev cable"));
  Process reader(net.a.Command({kPeer, "read", "140", "cable"}));
  Process writer(net.b.Command({kPeer, "write", "140", "cable", "20"}));
  ASSERT_TRUE(Eventually([&] { return writer.HasLine("alarm no_network"); })) << writer.Output();
  ASSERT_TRUE(Eventually([&] { return reader.HasLine("starts 1"); })) << reader.Output();
  std::this_thread::sleep_for(1s);
  EXPECT_EQ(Poses(reader), 0u);
  ASSERT_TRUE(net.b.Ip("addr add 10.77.0.2/24 dev cable"));
  EXPECT_TRUE(Eventually([&] { return Poses(reader) > 10; }, 10s))
      << reader.Output() << writer.Output();
  EXPECT_TRUE(writer.HasLine("starts 1"));
}

TEST_F(Network, AnAddressThatChangesIsFollowed) {
  const TwoMachines net;
  ASSERT_TRUE(net.is_made);
  ASSERT_TRUE(net.a.Ip("addr add 10.77.0.1/24 dev cable"));
  ASSERT_TRUE(net.b.Ip("addr add 10.77.0.2/24 dev cable"));
  Process reader(net.a.Command({kPeer, "read", "141", "cable"}));
  Process writer(net.b.Command({kPeer, "write", "141", "cable", "20"}));
  ASSERT_TRUE(Eventually([&] { return Poses(reader) > 10; }, 10s)) << reader.Output();
  ASSERT_TRUE(net.b.Ip("addr del 10.77.0.2/24 dev cable"));
  ASSERT_TRUE(net.b.Ip("addr add 10.77.0.3/24 dev cable"));
  ASSERT_TRUE(Eventually([&] { return writer.HasLine("starts 2"); })) << writer.Output();
  const std::size_t before = Poses(reader);
  EXPECT_TRUE(Eventually([&] { return Poses(reader) > before + 10; }, 10s))
      << reader.Output() << writer.Output();
}

// Seven seconds: longer than the lease after which both have forgotten each other.
TEST_F(Network, APulledCableIsReportedAndHealsWhenItIsBack) {
  const TwoMachines net;
  ASSERT_TRUE(net.is_made);
  ASSERT_TRUE(net.a.Ip("addr add 10.77.0.1/24 dev cable"));
  ASSERT_TRUE(net.b.Ip("addr add 10.77.0.2/24 dev cable"));
  Process reader(net.a.Command({kPeer, "read", "142", "cable"}));
  Process writer(net.b.Command({kPeer, "write", "142", "cable", "20"}));
  ASSERT_TRUE(Eventually([&] { return Poses(reader) > 10; }, 10s)) << reader.Output();
  ASSERT_TRUE(net.hub.Ip("link set pb down"));
  EXPECT_TRUE(Eventually([&] { return reader.HasLine("alarm silent machine-9"); }, 3s))
      << reader.Output();
  const std::size_t before = Poses(reader);
  std::this_thread::sleep_for(7s);
  EXPECT_EQ(Poses(reader), before);
  ASSERT_TRUE(net.hub.Ip("link set pb up"));
  EXPECT_TRUE(Eventually([&] { return Poses(reader) > before + 10; }, 15s))
      << reader.Output() << writer.Output();
}

// Listens on the cable while two processes talk, and says how many packets of a kind were on it.
int PacketsOnTheCable(const Namespace& machine,
                      const std::string& interface,
                      const std::string& kind = "",
                      const std::vector<std::string>& environment = {}) {
  Process capture(
      machine.Command({"tcpdump", "-i", "cable", "-n", "-l", "--immediate-mode", kind}));
  EXPECT_TRUE(Eventually([&] { return capture.HasLine("listening on cable"); }))
      << capture.Output();
  Process reader(machine.Command({kPeer, "read", "143", interface}), environment);
  Process writer(machine.Command({kPeer, "write", "143", interface, "20"}), environment);
  EXPECT_TRUE(Eventually([&] { return reader.HasLine("pose 60"); }, 10s)) << reader.Output();
  capture.Signal(SIGINT);
  capture.Wait();
  for (const std::string& line : capture.Lines()) {
    if (line.find("packets captured") != std::string::npos) return std::atoi(line.c_str());
  }
  return -1;
}

TEST_F(Network, NothingLeavesTheMachineBeforeItsOwnerSaysSo) {
  if (!Shell("which tcpdump > /dev/null")) GTEST_SKIP() << "tcpdump is not installed";
  const TwoMachines net;
  ASSERT_TRUE(net.is_made);
  ASSERT_TRUE(net.a.Ip("addr add 10.77.0.1/24 dev cable"));
  ASSERT_TRUE(net.a.Ip("route add default dev cable"));
  EXPECT_EQ(PacketsOnTheCable(net.a, "default"), 0);
  EXPECT_GT(PacketsOnTheCable(net.a, "cable", "multicast"), 0);  // the capture itself works
}

TEST_F(Network, WithPeersNoMulticastIsSent) {
  if (!Shell("which tcpdump > /dev/null")) GTEST_SKIP() << "tcpdump is not installed";
  const TwoMachines net;
  ASSERT_TRUE(net.is_made);
  ASSERT_TRUE(net.a.Ip("addr add 10.77.0.1/24 dev cable"));
  EXPECT_EQ(PacketsOnTheCable(net.a, "cable", "udp and multicast", {"TBM_PEER_UNICAST=10.77.0.1"}),
            0);
}

}  // namespace
}  // namespace tbm::dds::test
