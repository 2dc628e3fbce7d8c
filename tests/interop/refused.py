"""A program that tries what no farm has a use for, as an attacker in its process could."""

#: Tries what a farm has no use for, and what it needs: name -> number of the error, or 0, as JSON.
PROBE = """
import ctypes, json, os, platform, socket
libc = ctypes.CDLL(None, use_errno=True)
number = {"x86_64": dict(init_module=175, bpf=321, keyctl=250, perf_event_open=298, io_uring_setup=425),
          "aarch64": dict(init_module=105, bpf=280, keyctl=219, perf_event_open=241, io_uring_setup=425)}
said = {}

def call(name, function, *arguments):
    ctypes.set_errno(0)
    said[name] = ctypes.get_errno() if function(*arguments) == -1 else 0

def attempt(name, function, *arguments):
    try:
        said[name] = 0
        function(*arguments)
    except OSError as error:
        said[name] = error.errno

def in_child(name, function, *arguments):
    reading, writing = os.pipe()
    if (child := os.fork()) == 0:
        call(name, function, *arguments)
        os.write(writing, bytes([said[name]]))
        os._exit(0)
    os.waitpid(child, 0)
    said[name] = os.read(reading, 1)[0]

def write(place):
    path = os.path.join(place, "probe")
    with open(path, "w") as file:
        file.write("#!/usr/bin/python3")
    os.unlink(path)

def execute():
    with open("/tmp/probe", "w") as file:
        file.write("#!/usr/bin/python3")
    os.chmod("/tmp/probe", 0o755)
    try:
        os.waitpid(os.posix_spawn("/tmp/probe", ["/tmp/probe"], {}), 0)
    finally:
        os.unlink("/tmp/probe")

for place in ("/", "/rig", "/opt/pnfarm/cache", "/usr/local/bin", "/tmp", "/var/lib/pnfarm"):
    attempt("write " + place, write, place)
attempt("execute in /tmp", execute)
attempt("mknod", os.mknod, "/tmp/node", 0o600 | 0o020000, os.makedev(1, 1))
for family in ("AF_PACKET", "AF_NETLINK", "AF_INET", "AF_ALG", "AF_VSOCK"):
    kind = socket.SOCK_RAW if family in ("AF_PACKET", "AF_NETLINK") else socket.SOCK_SEQPACKET if family == "AF_ALG" \
        else socket.SOCK_STREAM
    attempt(family, lambda: socket.socket(getattr(socket, family), kind).close())
call("mount", libc.mount, b"none", b"/tmp", b"tmpfs", 0, None)
in_child("unshare", libc.unshare, 0x10000000)
in_child("ptrace", libc.ptrace, 0, 0, 0, 0)
in_child("personality", libc.personality, 0x0040000)
in_child("setuid", libc.setuid, 0)
call("setns", libc.setns, os.open("/proc/self/ns/net", os.O_RDONLY), 0)
for name, arguments in dict(init_module=(0, 0, b""), bpf=(0, 0, 0), keyctl=(0, -3, 1), perf_event_open=(0, 0, 0, 0, 0),
                            io_uring_setup=(0, 0)).items():
    call(name, libc.syscall, number[platform.machine()][name], *arguments)
print(json.dumps(said))
"""
