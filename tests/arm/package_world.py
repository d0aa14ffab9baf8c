"""Debian 12 root file systems in which the tests install packages.

Everything is made once from this system's own package sources and kept below build/arm/package_test. Tests
unpack a fresh copy, work in namespaces of their own (own_world.c) without any network but loopback, and delete
the copy.
"""
import atexit
import glob
import hashlib
import os
import re
import shutil
import subprocess
import sys
import tempfile
import time

SKIPPED = 77
# What a file system holds after a package was there, or may hold, without it being the package's.
NOT_OURS = re.compile(r"^/(proc|sys|dev|run|tmp|debs)(/|$)|^/var/(lib/(dpkg|apt)|log|cache)(/|$)"
                      r"|^/etc/(passwd-|group-|shadow-|gshadow-|subuid-?|subgid-?|\.pwd\.lock|ld\.so\.cache)$")


def skip(why):
    print(f"skipped: {why}")
    sys.exit(SKIPPED)


def need(tools):
    """Skips unless this is root on a kernel and with tools that can do it."""
    if os.geteuid() != 0:
        skip("needs root: namespaces and a root file system")
    release = tuple(int(part) for part in re.findall(r"\d+", os.uname().release)[:2])
    if release < (6, 7):
        skip(f"needs Linux 6.7 for a private registration of the emulator; this is {os.uname().release}")
    missing = [tool for tool in tools if shutil.which(tool) is None]
    if missing:
        skip(f"needs {', '.join(missing)}: tools/setup arm")


def run(command, **options):
    """Output of a command that must succeed."""
    done = subprocess.run(command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True,
                          stdin=subprocess.DEVNULL, check=False, **options)
    if done.returncode != 0:
        sys.exit(f"FAILED ({done.returncode}): {' '.join(map(str, command))}\n{done.stdout}")
    return done.stdout


class Checks:
    """Goes on after a fault; `end` says how it went."""

    def __init__(self):
        self.faults = 0
        self.began = time.monotonic()

    def that(self, condition, what, detail=""):
        print(f"{'ok    ' if condition else 'FAULT '} {what}"
              + (f"\n{detail}" if detail and not condition else ""), flush=True)
        self.faults += 0 if condition else 1

    def equal(self, found, wanted, what):
        self.that(found == wanted, what, f"  found  {found!r}\n  wanted {wanted!r}")

    def step(self, what):
        print(f"{time.monotonic() - self.began:6.1f} s  {what}", flush=True)

    def end(self):
        self.step(f"{self.faults} faults")
        sys.exit(1 if self.faults else 0)


def pack(source, tree, out, version=None):
    """The packages of a build tree, as tools/package/build makes them."""
    if not os.path.exists(f"{tree}/bin/camera_box") or not os.path.exists(f"{tree}/CPackConfig.cmake"):
        skip(f"{tree} holds no camera_box: tools/package/build")
    command = [f"{source}/tools/package/build", "--tree", tree, "--out", out]
    lines = run(command + (["--version", version] if version else [])).split()
    return {os.path.basename(path).split("_")[0]: path for path in lines}


class World:
    def __init__(self, source, own_world, architecture, packages=()):
        self.own_world = own_world
        self.architecture = architecture
        self.packages = packages
        self.cache = f"{source}/build/arm/package_test"
        os.makedirs(self.cache, exist_ok=True)

    def _recipe(self):
        return "_".join([self.architecture, *self.packages])

    def base(self):
        """Tar of a minimal Debian 12 and `packages`."""
        tar = f"{self.cache}/{self._recipe()}.tar"
        if os.path.exists(tar):
            return tar
        sources = [name for name in ["/etc/apt/sources.list", *sorted(glob.glob("/etc/apt/sources.list.d/*"))]
                   if name.endswith((".list", ".sources")) and os.path.exists(name)]
        # One index that cannot be had (a mirror in the middle of an update) is no reason to have nothing.
        command = [self.own_world, "mmdebstrap", "--mode=root", f"--arch={self.architecture}",
                   "--variant=minbase", "--skip=check/empty,check/qemu,update",
                   "--setup-hook=APT_CONFIG=\"$MMDEBSTRAP_APT_CONFIG\" apt-get update || true",
                   "bookworm", f"{tar}.new", *sources, "--format=tar"]
        if self.packages:
            command.insert(2, f"--include={','.join(self.packages)}")
        with open(f"{tar}.log", "w", encoding="utf-8") as log:
            done = subprocess.run(command, stdout=log, stderr=log, stdin=subprocess.DEVNULL, check=False)
        if done.returncode != 0:
            with open(f"{tar}.log", encoding="utf-8") as log:
                print(log.read()[-3000:])
            skip("no base system could be made from this system's package sources")
        os.rename(f"{tar}.new", tar)
        return tar

    def unpack(self):
        """A fresh root, deleted when the test ends."""
        tar = self.base()
        root = tempfile.mkdtemp(prefix="root_", dir=self.cache)
        os.chmod(root, 0o755)
        atexit.register(shutil.rmtree, root, ignore_errors=True)
        run(["tar", "-x", "--numeric-owner", "-p", "-f", tar, "-C", root])
        return root

    def dependencies(self, root, package):
        """Paths of all packages that installing `package` into `root` needs beside it."""
        depends = run(["dpkg-deb", "-f", package, "Depends"])
        key = hashlib.sha256((self._recipe() + depends).encode()).hexdigest()[:16]
        folder = f"{self.cache}/debs_{self.architecture}_{key}"
        if not os.path.isdir(folder):
            self._download(root, package, folder)
        return sorted(glob.glob(f"{folder}/*.deb"))

    def _download(self, root, package, folder):
        apt = f"{self.cache}/apt_{self.architecture}"
        shutil.rmtree(f"{apt}/archives", ignore_errors=True)
        for part in ("state/lists/partial", "archives/partial"):
            os.makedirs(f"{apt}/{part}", exist_ok=True)
        with open(f"{apt}/apt.conf", "w", encoding="utf-8") as config:
            config.write(f'APT::Architecture "{self.architecture}";\n'
                         f'APT::Architectures {{ "{self.architecture}"; }};\n'
                         f'Dir::State "{apt}/state";\n'
                         f'Dir::State::status "{root}/var/lib/dpkg/status";\n'
                         f'Dir::Cache::archives "{apt}/archives";\n'
                         'Dir::Cache::pkgcache "";\nDir::Cache::srcpkgcache "";\n'
                         'APT::Sandbox::User "root";\nAPT::Keep-Downloaded-Packages "true";\n')
        environment = {**os.environ, "APT_CONFIG": f"{apt}/apt.conf", "LC_ALL": "C"}
        update = subprocess.run(["apt-get", "update"], env=environment, stdin=subprocess.DEVNULL,
                                stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, check=False)
        done = subprocess.run(["apt-get", "install", "-y", "--no-install-recommends", "--download-only", package],
                              env=environment, stdin=subprocess.DEVNULL, stdout=subprocess.PIPE,
                              stderr=subprocess.STDOUT, text=True, check=False)
        if "unmet dependencies" in done.stdout:
            sys.exit(f"FAILED: the package's dependencies cannot be met\n{done.stdout}")
        if done.returncode != 0:
            print(update.stdout[-2000:], done.stdout[-2000:])
            skip("the packages that it depends on cannot be downloaded")
        for old in glob.glob(f"{self.cache}/debs_{self.architecture}_*"):
            shutil.rmtree(old)
        os.makedirs(f"{folder}.new")
        for deb in glob.glob(f"{apt}/archives/*.deb"):
            shutil.move(deb, f"{folder}.new/")
        os.rename(f"{folder}.new", folder)

    def inside(self, root, command, environment=(), check=True):
        """Runs a command in `root`: as its root user, with nothing but a loopback network."""
        script = ('mount -t proc proc "$0/proc" && mount -t tmpfs tmpfs "$0/run" && exec chroot "$0" "$@"')
        full = [self.own_world, "--loopback", "env", "-i", "PATH=/usr/sbin:/usr/bin:/sbin:/bin", "LC_ALL=C",
                "DEBIAN_FRONTEND=noninteractive", *environment, "sh", "-c", script, root, *command]
        if check:
            return run(full)
        return subprocess.run(full, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True,
                              stdin=subprocess.DEVNULL, check=False)

    def install(self, root, debs, options=()):
        folder = f"{root}/debs"
        shutil.rmtree(folder, ignore_errors=True)
        os.makedirs(folder)
        names = []
        for deb in debs:
            shutil.copy(deb, folder)
            names.append("/debs/" + os.path.basename(deb))
        # Nobody's data is at stake here: no waiting for the disk.
        self.inside(root, ["dpkg", "--force-unsafe-io", *options, "-i", *names])
        shutil.rmtree(folder)

    def install_dependencies(self, root, package):
        """Installs all that `package` needs beside it; how many packages that is."""
        debs = self.dependencies(root, package)
        # dpkg does not configure what another one in the same call has to have before it is unpacked.
        last = [deb for deb in debs if os.path.basename(deb).startswith("systemd_")]
        self.install(root, [deb for deb in debs if deb not in last])
        if last:
            self.install(root, last)
        return len(debs)


def snapshot(root):
    """What a file system holds: path -> kind, rights, owner, and for /etc the contents."""
    found = {}
    for folder, folders, files in os.walk(root):
        for name in folders + files:
            path = os.path.join(folder, name)
            inside = path[len(root):]
            if NOT_OURS.match(inside):
                continue
            status = os.lstat(path)
            contents = ""
            if inside.startswith("/etc/") and os.path.isfile(path) and not os.path.islink(path):
                with open(path, "rb") as file:
                    contents = hashlib.sha256(file.read()).hexdigest()
            found[inside] = (oct(status.st_mode), status.st_uid, status.st_gid, contents)
    return found


def shlibdeps(root, program, architecture, own_world):
    """What dpkg-shlibdeps says that `program` depends on, with the libraries installed in `root`."""
    triplet = {"armhf": "arm-linux-gnueabihf", "amd64": "x86_64-linux-gnu"}[architecture]
    with tempfile.TemporaryDirectory() as work:
        os.makedirs(f"{work}/debian")
        with open(f"{work}/debian/control", "w", encoding="utf-8") as control:
            control.write("Source: any\n")
        os.makedirs(f"{work}/upper")
        os.makedirs(f"{work}/scratch")
        # dpkg-shlibdeps looks below /usr/lib only: the root's libraries are put there, for it alone.
        script = (f"mount -t tmpfs tmpfs {work}/upper && mkdir {work}/upper/u {work}/upper/w && "
                  f"mount -t overlay overlay -o lowerdir=/usr/lib,upperdir={work}/upper/u,workdir={work}/upper/w /usr/lib"
                  f" && mkdir -p /usr/lib/{triplet} && mount --bind {root}/usr/lib/{triplet} /usr/lib/{triplet} && "
                  f"cd {work} && dpkg-shlibdeps --admindir={root}/var/lib/dpkg -O -e{program} 2>{work}/said || "
                  f"{{ cat {work}/said; exit 1; }}")
        line = run([own_world, "sh", "-c", script],
                   env={**os.environ, "DEB_HOST_ARCH": architecture, "LC_ALL": "C"})
    return parse_depends(line.strip().removeprefix("shlibs:Depends="))


def parse_depends(text):
    """'a (>= 1), b | c' -> {'a': '1', 'b | c': ''}"""
    wanted = {}
    for item in filter(None, (part.strip() for part in text.split(","))):
        versions = re.findall(r"\(>= ([^)]*)\)", item)
        wanted[re.sub(r" *\([^)]*\)", "", item)] = versions[0] if versions else ""
    return wanted


def check_dependencies(checks, declared, wanted, beside=()):
    """`declared` names exactly the libraries of `wanted`, in no lower version, and `beside` what is no library."""
    checks.equal(set(declared) - set(beside), set(wanted), "Depends names the libraries that dpkg-shlibdeps names")
    low = [name for name, version in wanted.items()
           if version and not (declared.get(name) and at_least(declared[name], version))]
    checks.equal(low, [], "no version in Depends is too low")


def at_least(version, other):
    return subprocess.run(["dpkg", "--compare-versions", version, "ge", other], check=False).returncode == 0
