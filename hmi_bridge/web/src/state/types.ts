import type {components} from '../generated/openapi';

type Schemas = components['schemas'];

export type Snapshot = Schemas['Snapshot'];
export type Sections = Schemas['Sections'];
export type Timing = Schemas['Timing'];
export type Validity = Schemas['Validity'];
export type Machine = Schemas['Machine'];
export type Guidance = Schemas['Guidance'];
export type Point = Schemas['Point'];
export type Shield = Schemas['Shield'];
export type Camera = Schemas['Camera'];
export type Frame = NonNullable<Camera['frame']>;
export type Spot = Frame['spots'][number];
export type Tilt = Schemas['Tilt'];
export type Station = Schemas['Station'];
export type SetUp = Schemas['SetUp'];
export type Device = Schemas['Device'];
export type Alarms = Schemas['Alarms'];
export type Alarm = Schemas['Alarm'];
export type ConsoleEvent = Schemas['Event'];
export type Command = Schemas['Command'];
export type History = Schemas['History'];
export type Me = Schemas['Me'];
export type Role = Me['role'];
export type Urgency = Alarm['urgency'];
export type CommandRequest = {addressee: string; verb: string; argument: string; because: string};
