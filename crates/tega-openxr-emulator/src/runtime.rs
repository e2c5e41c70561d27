//! What an instance and its only session know. Nothing here is a pointer.

use std::collections::{HashMap, VecDeque};

use openxr_sys::{Posef, Quaternionf, Result as Code, SessionState, SpaceLocationFlags, Time, Vector3f};

use crate::service::Service;

/// A code other than success.
pub type Outcome<T> = Result<T, Code>;

/// Extensions that it knows; the service says which of them it offers.
pub const HEADLESS: &str = "XR_MND_headless";

/// A runtime's clock is its own: it is so far ahead of the monotonic one.
const AHEAD_NS: i64 = 7_123_456_789_012;

/// Profiles it has devices for.
const PROFILES: [&str; 2] =
    ["/interaction_profiles/khr/simple_controller", "/interaction_profiles/htc/vive_tracker_htcx"];

/// What a space stands for.
#[derive(Clone)]
pub enum Place {
    /// `local` or `stage`.
    Reference(&'static str),
    /// An action's pose, below a user path.
    Action { action: u64, user: String },
}

/// An event for the application.
pub enum Told {
    /// The session's state has changed.
    State(SessionState),
    /// The origin is about to be elsewhere.
    Recentred,
    /// The devices that are held have changed.
    Profile,
    /// The instance is about to be lost.
    InstanceLoss,
}

/// Where something is.
pub struct Located {
    pub flags: SpaceLocationFlags,
    pub pose: Posef,
}

impl Located {
    const NOWHERE: Self = Self { flags: SpaceLocationFlags::EMPTY, pose: Posef::IDENTITY };

    /// Reads `FLAGS x y z qx qy qz qw`.
    fn read(answer: &str) -> Option<Self> {
        let (flags, rest) = answer.split_once(' ')?;
        let n: Vec<f32> = rest.split(' ').map(str::parse).collect::<Result<_, _>>().ok()?;
        let &[x, y, z, qx, qy, qz, qw] = n.as_slice() else { return None };
        Some(Self {
            flags: SpaceLocationFlags::from_raw(flags.parse().ok()?),
            pose: Posef {
                orientation: Quaternionf { x: qx, y: qy, z: qz, w: qw },
                position: Vector3f { x, y, z },
            },
        })
    }
}

/// The session.
struct Session {
    state: SessionState,
    is_exit_requested: bool,
    is_attached: bool,
    is_synced: bool,
}

/// The instance.
pub struct Runtime {
    /// `None` once it is gone.
    service: Option<Service>,
    extensions: Vec<String>,
    paths: Vec<String>,
    last_handle: u64,
    session: Option<Session>,
    events: VecDeque<Told>,
    bindings: HashMap<u64, Vec<String>>,
    spaces: HashMap<u64, Place>,
    hands: HashMap<u64, &'static str>,
}

/// Asks the service which extensions there are.
pub fn offered(service: &mut Service) -> Outcome<Vec<String>> {
    let answer = service.ask("extensions").ok_or(Code::ERROR_RUNTIME_FAILURE)?;
    Ok(answer.split_whitespace().map(str::to_owned).collect())
}

/// The monotonic clock's time of one of this runtime's.
pub fn to_monotonic_ns(time: Time) -> Outcome<i64> {
    if time.as_nanos() <= 0 {
        return Err(Code::ERROR_TIME_INVALID);
    }
    Ok(time.as_nanos() - AHEAD_NS)
}

/// This runtime's time of one of the monotonic clock's.
pub fn from_monotonic_ns(ns: i64) -> Time {
    Time::from_nanos(ns.saturating_add(AHEAD_NS))
}

impl Runtime {
    /// Connects to the service, which has to offer what is asked for.
    pub fn new(extensions: Vec<String>) -> Outcome<Self> {
        let mut service = Service::connect().ok_or(Code::ERROR_RUNTIME_UNAVAILABLE)?;
        let there = offered(&mut service)?;
        if extensions.iter().any(|wanted| !there.contains(wanted)) {
            return Err(Code::ERROR_EXTENSION_NOT_PRESENT);
        }
        Ok(Self {
            service: Some(service),
            extensions,
            paths: Vec::new(),
            last_handle: 1,
            session: None,
            events: VecDeque::new(),
            bindings: HashMap::new(),
            spaces: HashMap::new(),
            hands: HashMap::new(),
        })
    }

    /// Whether the application has asked for an extension.
    pub fn has(&self, extension: &str) -> bool {
        self.extensions.iter().any(|known| known == extension)
    }

    /// Gives a handle that was never given before.
    pub fn handle(&mut self) -> u64 {
        self.last_handle += 1;
        self.last_handle
    }

    /// Asks the service; once it is gone the session, and with it the instance, are lost.
    fn ask(&mut self, question: &str) -> Outcome<String> {
        if let Some(service) = &mut self.service {
            if let Some(answer) = service.ask(question) {
                return Ok(answer);
            }
            self.service = None;
            self.events.push_back(match self.session {
                Some(_) => Told::State(SessionState::LOSS_PENDING),
                None => Told::InstanceLoss,
            });
        }
        Err(self.lost())
    }

    fn lost(&self) -> Code {
        if self.session.is_some() { Code::ERROR_SESSION_LOST } else { Code::ERROR_INSTANCE_LOST }
    }

    fn session(&mut self) -> Outcome<&mut Session> {
        self.session.as_mut().ok_or(Code::ERROR_HANDLE_INVALID)
    }

    /// Gives the next event and its time.
    pub fn event(&mut self) -> Outcome<(Told, Time)> {
        let mut now_ns = 0;
        if let Ok(answer) = self.ask("event") {
            let mut words = answer.split(' ');
            now_ns = words.next().and_then(|w| w.parse().ok()).unwrap_or(0);
            let told = match words.next() {
                Some("recentred") => Some(Told::Recentred),
                Some("profile") => Some(Told::Profile),
                Some("instance-loss") => Some(Told::InstanceLoss),
                Some(state) => state_of(state).map(Told::State),
                None => None,
            };
            self.events.extend(told);
        }
        let told = self.events.pop_front().ok_or(Code::EVENT_UNAVAILABLE)?;
        if let (Told::State(state), Some(session)) = (&told, &mut self.session) {
            session.state = *state;
        }
        Ok((told, from_monotonic_ns(now_ns)))
    }

    /// Gives the path of a text; the same text has the same path.
    pub fn path(&mut self, text: &str) -> Outcome<u64> {
        if !text.starts_with('/') || text.ends_with('/') {
            return Err(Code::ERROR_PATH_FORMAT_INVALID);
        }
        if let Some(at) = self.paths.iter().position(|known| known == text) {
            return Ok(at as u64 + 1);
        }
        self.paths.push(text.to_owned());
        Ok(self.paths.len() as u64)
    }

    /// Gives the text of a path.
    pub fn path_text(&self, path: u64) -> Outcome<&str> {
        let at = (path as usize).checked_sub(1).ok_or(Code::ERROR_PATH_INVALID)?;
        self.paths.get(at).map(String::as_str).ok_or(Code::ERROR_PATH_INVALID)
    }

    /// Makes the session, which has no graphics.
    pub fn create_session(&mut self) -> Outcome<u64> {
        if !self.has(HEADLESS) {
            return Err(Code::ERROR_GRAPHICS_DEVICE_INVALID);
        }
        if self.session.is_some() {
            return Err(Code::ERROR_LIMIT_REACHED);
        }
        let answer = self.ask("session")?;
        self.session = Some(Session {
            state: SessionState::UNKNOWN,
            is_exit_requested: false,
            is_attached: false,
            is_synced: false,
        });
        self.events.push_back(Told::State(SessionState::IDLE));
        if answer == "ready" {
            self.events.push_back(Told::State(SessionState::READY));
        }
        Ok(self.handle())
    }

    /// Begins the session; one without graphics has nothing to wait for until it is in focus.
    pub fn begin_session(&mut self) -> Outcome<()> {
        if self.session()?.state != SessionState::READY {
            return Err(Code::ERROR_SESSION_NOT_READY);
        }
        if self.ask("begin")? != "stuck" {
            let states = [SessionState::SYNCHRONIZED, SessionState::VISIBLE, SessionState::FOCUSED];
            self.events.extend(states.map(Told::State));
        }
        Ok(())
    }

    /// Takes the application's wish to leave.
    pub fn request_exit(&mut self) -> Outcome<()> {
        self.session()?.is_exit_requested = true;
        self.events.push_back(Told::State(SessionState::STOPPING));
        Ok(())
    }

    /// Ends the session.
    pub fn end_session(&mut self) -> Outcome<()> {
        let session = self.session()?;
        if session.state != SessionState::STOPPING {
            return Err(Code::ERROR_SESSION_NOT_STOPPING);
        }
        let is_last = session.is_exit_requested;
        self.ask("end")?;
        self.events.push_back(Told::State(SessionState::IDLE));
        if is_last {
            self.events.push_back(Told::State(SessionState::EXITING));
        }
        Ok(())
    }

    /// Forgets the session and what belongs to it.
    pub fn destroy_session(&mut self) {
        self.session = None;
        self.spaces.clear();
        self.hands.clear();
        self.events.clear();
    }

    /// Makes a space, or a hand's tracker.
    pub fn create_space(&mut self, place: Place) -> u64 {
        let handle = self.handle();
        self.spaces.insert(handle, place);
        handle
    }

    /// Makes the tracker of a hand's joints.
    pub fn create_hand(&mut self, user: &'static str) -> Outcome<u64> {
        if !self.has("XR_EXT_hand_tracking") {
            return Err(Code::ERROR_FUNCTION_UNSUPPORTED);
        }
        let handle = self.handle();
        self.hands.insert(handle, user);
        Ok(handle)
    }

    /// Takes which inputs of a profile an action could be bound to.
    pub fn suggest(&mut self, profile: u64, bindings: &[(u64, u64)]) -> Outcome<()> {
        let profile = self.path_text(profile)?.to_owned();
        let is_vive = profile.ends_with("_htcx");
        if !PROFILES.contains(&profile.as_str()) || (is_vive && !self.has("XR_HTCX_vive_tracker_interaction"))
        {
            return Err(Code::ERROR_PATH_UNSUPPORTED);
        }
        if self.session.as_ref().is_some_and(|session| session.is_attached) {
            return Err(Code::ERROR_ACTIONSETS_ALREADY_ATTACHED);
        }
        for &(action, path) in bindings {
            let path = self.path_text(path)?.to_owned();
            let users = if is_vive { "/user/vive_tracker_htcx/role/" } else { "/user/hand/" };
            if !path.starts_with(users) || !path.ends_with("/pose") {
                return Err(Code::ERROR_PATH_UNSUPPORTED);
            }
            self.bindings.entry(action).or_default().push(path);
        }
        Ok(())
    }

    /// Says what is held, or strapped on, at a user path: what was suggested for it first.
    pub fn profile(&mut self, user: u64) -> Outcome<u64> {
        let user = self.path_text(user)?.to_owned();
        if self.ask("held")? == "no" || !self.bindings.values().flatten().any(|path| path.starts_with(&user))
        {
            return Ok(0);
        }
        let is_vive = user.starts_with("/user/vive_tracker_htcx/");
        self.path(PROFILES[usize::from(is_vive)])
    }

    /// From here on the actions are what they are.
    pub fn attach(&mut self) -> Outcome<()> {
        if std::mem::replace(&mut self.session()?.is_attached, true) {
            return Err(Code::ERROR_ACTIONSETS_ALREADY_ATTACHED);
        }
        Ok(())
    }

    /// Brings the actions up to date.
    pub fn sync(&mut self) -> Outcome<()> {
        if self.service.is_none() {
            return Err(Code::ERROR_SESSION_LOST);
        }
        let session = self.session()?;
        if !session.is_attached {
            return Err(Code::ERROR_ACTIONSET_NOT_ATTACHED);
        }
        session.is_synced = session.state == SessionState::FOCUSED;
        if session.is_synced { Ok(()) } else { Err(Code::SESSION_NOT_FOCUSED) }
    }

    /// Says where a space is; an action's is nowhere before the actions were synchronised in focus.
    pub fn locate(&mut self, space: u64, base: u64, time: Time) -> Outcome<Located> {
        let at_ns = to_monotonic_ns(time)?;
        let Some(&Place::Reference(base)) = self.spaces.get(&base) else {
            return Err(Code::ERROR_HANDLE_INVALID);
        };
        match self.spaces.get(&space).ok_or(Code::ERROR_HANDLE_INVALID)?.clone() {
            Place::Reference(_) => Ok(Located::NOWHERE),
            Place::Action { action, user } => {
                let bound = self.bindings.get(&action).into_iter().flatten();
                let input = bound
                    .filter_map(|path| path.strip_prefix(user.as_str()))
                    .find_map(|rest| rest.strip_prefix("/input/")?.strip_suffix("/pose"));
                match input {
                    Some(input) if self.session.as_ref().is_some_and(|session| session.is_synced) => {
                        let question = format!("locate {user} {input} {base} {at_ns}");
                        self.located(&question)
                    }
                    _ if self.service.is_none() => Err(self.lost()),
                    _ => Ok(Located::NOWHERE),
                }
            }
        }
    }

    /// Says where the wrist of a hand is.
    pub fn locate_wrist(&mut self, hand: u64, base: u64, time: Time) -> Outcome<Located> {
        let at_ns = to_monotonic_ns(time)?;
        let Some(&Place::Reference(base)) = self.spaces.get(&base) else {
            return Err(Code::ERROR_HANDLE_INVALID);
        };
        let user = *self.hands.get(&hand).ok_or(Code::ERROR_HANDLE_INVALID)?;
        self.located(&format!("locate {user} wrist {base} {at_ns}"))
    }

    fn located(&mut self, question: &str) -> Outcome<Located> {
        let answer = self.ask(question)?;
        Located::read(&answer).ok_or(Code::ERROR_RUNTIME_FAILURE)
    }
}

/// The state of a name.
fn state_of(name: &str) -> Option<SessionState> {
    Some(match name {
        "idle" => SessionState::IDLE,
        "ready" => SessionState::READY,
        "synchronized" => SessionState::SYNCHRONIZED,
        "visible" => SessionState::VISIBLE,
        "focused" => SessionState::FOCUSED,
        "stopping" => SessionState::STOPPING,
        "loss-pending" => SessionState::LOSS_PENDING,
        "exiting" => SessionState::EXITING,
        _ => return None,
    })
}
